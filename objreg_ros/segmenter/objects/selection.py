# SPDX-License-Identifier: Apache-2.0
"""The parts of a surface that are the object in a box.

The box is evidence: it encloses the object tightly, give or take some percent. So parts that leave the box belong to
something else, and the right parts together fill it from edge to edge. What is only hidden by others is background.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.native import kernels
from objreg_ros.segmenter.surface.cells import Window
from objreg_ros.segmenter.surface.parts import Parts

_KERNELS = kernels("selection")


def select(parts: Parts, window: Window) -> Array:
    """(h, w) bool: the cells of the parts that are the object in ``window``; none if no part is there.

    The seed fits the box best; parts next to what is selected are added while the fit gets better, and in the end
    those that lie within it and not on it, as the inside of a bowl does.
    """
    return np.asarray(_KERNELS.select(parts, window))
