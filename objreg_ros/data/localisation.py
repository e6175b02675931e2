# SPDX-License-Identifier: Apache-2.0
"""How sure a registrar is of where its camera is."""

from __future__ import annotations

from enum import IntEnum

from objreg_ros.data.checked import data_type, require
from objreg_ros.data.closures import LoopClosure


class State(IntEnum):
    """What objreg_msgs/LocalisationState says under the same names."""

    TRACKING = 0
    SURE = 1
    UNSURE = 2
    AMBIGUOUS = 3
    LOST = 4
    KIDNAPPED = 5


@data_type
class LocalisationState:
    """The ``state`` at the frame of ``stamp_ns``, and a sentence with numbers why.

    ``closure`` is the last that agrees, ``age_s`` seconds ago: None and NaN before the first. ``odds`` that the camera
    is where odometry says and not elsewhere. ``probability`` that the pose in the map of an earlier session is within
    0.5 m of the truth, and ``sigma_m`` of each axis of that: NaN where no map is tied.
    """

    stamp_ns: int
    state: State
    reason: str
    age_s: float
    odds: float
    probability: float
    sigma_m: float
    closure: LoopClosure | None = None

    def __post_init__(self) -> None:
        require(self, self.odds >= 0.0, "odds of 0 or more", self.odds)
        require(self, not self.probability > 1.0, "a probability of at most 1", self.probability)
