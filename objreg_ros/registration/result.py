# SPDX-License-Identifier: Apache-2.0
"""What `align` gives: a pose with its covariance, or no pose; the reason and the evidence either way."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import Reason
from objreg_ros.geometry import skew
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.gate.kinds import readings_of
from objreg_ros.registration.gate.likelihood import log_odds


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AcceptedRegistration:
    """Two keyframes, or two pictures, laid upon each other: the first is the target, the second the source.

    ``T_target_source (4, 4) float64`` maps points of the source's camera into the target's, in metres: ``p_1 = T_1_2 @
    p_2``. ``covariance (6, 6) float64`` is of ``[tx ty tz rx ry rz]`` in the axes of the target's camera, m and rad, in
    the order of ROS. ``evidence`` are named numbers of ``candidate``, which was accepted.
    """

    T_target_source: Array
    covariance: Array
    evidence: dict[str, float] = field(default_factory=dict)
    candidate: Candidate | None = None
    accepted: Literal[True] = field(default=True, init=False)
    reason: None = field(default=None, init=False)
    detail: str = field(default="", init=False)

    @property
    def T_1_2(self) -> Array:
        """``T_target_source``: maps points of camera 2 into camera 1."""
        return self.T_target_source

    def between(self, T_first_target: Array, T_source_second: Array) -> AcceptedRegistration:
        """The same between two other cameras, of which the poses beside the target's and the source's are known.

        ``candidate`` stays that of target and source.
        """
        T, C = self.T_target_source, self.covariance
        arm = T[:3, :3] @ T_source_second[:3, 3]  # from the source's camera to the second, which a turn swings
        R, swung = T_first_target[:3, :3], np.eye(6)
        swung[:3, 3:] = -skew(arm)
        turned = np.kron(np.eye(2), R)
        J = turned @ swung
        return replace(self, T_target_source=T_first_target @ T @ T_source_second, covariance=J @ C @ J.T)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RefusedRegistration:
    """Two keyframes, or two pictures, without a pose: ``reason`` says why, ``detail`` with which numbers.

    ``evidence`` are named numbers of the best ``candidate``, empty and None where no pose was proposed. Its pose is for
    a look at it and nothing else.
    """

    reason: Reason | None
    detail: str = ""
    evidence: dict[str, float] = field(default_factory=dict)
    candidate: Candidate | None = None
    accepted: Literal[False] = field(default=False, init=False)
    T_target_source: None = field(default=None, init=False)
    covariance: None = field(default=None, init=False)

    @property
    def T_1_2(self) -> None:
        """None."""
        return None

    def between(self, T_first_target: Array, T_source_second: Array) -> RefusedRegistration:
        """The same refusal, between two other cameras."""
        return self


Registration = AcceptedRegistration | RefusedRegistration
"""What becomes of two keyframes or pictures. Where ``accepted`` is True it has a pose, as type checkers know too."""


def evidence_of(candidate: Candidate) -> dict[str, float]:
    """The numbers of a candidate: its odds, the reading of each of the gate's `KINDS`, and what else is known of it.

    The odds are those of the readings: `log_odds` of these numbers gives them again. What is not known is left out.
    """
    readings, seen = readings_of(candidate), candidate.verification
    numbers: dict[str, float | None] = {
        "odds": 10.0 ** log_odds(readings),
        **readings,
        "score": seen.score,
        "inliers": seen.inliers,
        "violations": seen.violations,
        "occluded": seen.occluded,
        "keypoints": None if candidate.keypoints is None else candidate.keypoints.cells,
        "overlap": candidate.alignment.overlap,
        "moved": len(candidate.moved),
        "gravity_error_deg": candidate.gravity_error_deg,
        "surroundings_score": None if candidate.surroundings is None else candidate.surroundings.score,
        "yaw_known": candidate.yaw_known,
    }
    return {name: float(number) for name, number in numbers.items() if number is not None}
