# SPDX-License-Identifier: Apache-2.0
"""From a scene to an ideal picture: rasteriser, lamps, shadows, lens."""
