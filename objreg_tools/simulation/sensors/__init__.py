# SPDX-License-Identifier: Apache-2.0
"""What a camera makes of an ideal picture: its colour, and the errors of its depth."""
