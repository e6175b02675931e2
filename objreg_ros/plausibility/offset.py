# SPDX-License-Identifier: Apache-2.0
"""By how much a measured number is not what the camera says, and what that comes to."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from objreg_ros.plausibility.camera_fit import CameraFit

SHARE = 0.05  # a number that is off by no more is right
CLOSE = 0.07  # a number that is off by less, its deviation added, is believed
VAGUE_SIGMAS = 4.0  # of a number whose deviation is more than that


class Offset(NamedTuple):
    """Its ``size``, a share, and its deviation ``sigma``."""

    size: float
    sigma: float

    def is_wrong(self, sigmas: float) -> bool:
        """Whether it is more than a right camera has, and so many deviations."""
        needed = max(sigmas, VAGUE_SIGMAS) if self.is_vague else sigmas
        return bool(self.size > SHARE and self.size > needed * self.sigma)

    @property
    def is_vague(self) -> bool:
        """Whether little is known of it."""
        return self.sigma >= CLOSE

    @property
    def is_close(self) -> bool:
        """Whether it is surely little."""
        return bool(self.size + self.sigma < CLOSE)


def offsets(fit: CameraFit) -> tuple[Offset, Offset, Offset]:
    """Of the focal length, by its logarithm, and of the principal point, in widths of the picture."""
    (x, y), (sigma_x, sigma_y) = np.abs(fit.centre), fit.centre_sigma
    return Offset(abs(float(np.log(fit.focal))), fit.focal_sigma), Offset(x, sigma_x), Offset(y, sigma_y)
