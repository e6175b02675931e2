# SPDX-License-Identifier: Apache-2.0
"""What the sensor gives: clouds brought into an image, depth upon colour, its noise, and the view that is kept."""
