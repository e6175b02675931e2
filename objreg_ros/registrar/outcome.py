# SPDX-License-Identifier: Apache-2.0
"""What the registrar says of a frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from objreg_ros.data.closures import LoopClosure, Observation, Rejected


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What became of a frame: accepted closures, refusals with reasons, and the keyframe that it completed, if any.

    ``withdrawn`` are closures of before that a person has vetoed.
    With the objects of that keyframe under the ids of their landmarks, its camera, its session and its robot.
    """

    closures: tuple[LoopClosure, ...] = ()
    withdrawn: tuple[LoopClosure, ...] = ()
    rejected: tuple[Rejected, ...] = ()
    keyframe_ns: int | None = None
    keyframe_id: int | None = None
    observations: tuple[Observation, ...] = ()
    frame_id: str = "camera"
    session: int | None = None
    robot: str = ""

    def with_late(self, late: Outcome) -> Outcome:
        """With what became of earlier keyframes' poses; a late constraint keeps its own stamps."""
        return replace(self, closures=self.closures + late.closures, rejected=self.rejected + late.rejected)


def in_turn(outcomes: Sequence[Outcome]) -> Outcome:
    """The last of several, with the closures and refusals of all; an empty one for none."""
    closures = [closure for outcome in outcomes for closure in outcome.closures]
    refused = [refusal for outcome in outcomes for refusal in outcome.rejected]
    return replace(outcomes[-1] if outcomes else Outcome(), closures=tuple(closures), rejected=tuple(refused))
