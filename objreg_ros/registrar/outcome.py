# SPDX-License-Identifier: Apache-2.0
"""What the registrar says of a frame."""

from __future__ import annotations

from dataclasses import dataclass, replace

from objreg_ros.data import LoopClosure, Observation, Rejected


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What became of a frame: accepted closures, refusals with reasons, and the keyframe that it completed, if any.

    With the objects of that keyframe under the ids of their landmarks, its camera and its session.
    """

    closures: tuple[LoopClosure, ...] = ()
    rejected: tuple[Rejected, ...] = ()
    keyframe_ns: int | None = None
    observations: tuple[Observation, ...] = ()
    frame_id: str = "camera"
    session: int | None = None

    def with_late(self, late: Outcome) -> Outcome:
        """With what became of earlier keyframes' poses; a late constraint keeps its own stamps."""
        return replace(self, closures=self.closures + late.closures, rejected=self.rejected + late.rejected)
