# SPDX-License-Identifier: Apache-2.0
"""What a camera is and where it sits: calibration, lens, depth registered to colour, the tree of frames, mount."""
