# SPDX-License-Identifier: Apache-2.0
"""Which places robots saw that another robot had seen before, by truth, and where a right constraint ties the two.

A keyframe is a meeting with another robot when an earlier keyframe of that one saw the same surfaces
(`report.run.revisits` says how much). Meetings that follow each other are one stretch. A constraint between the two
robots closes a meeting when it is right (5 degrees, 10 cm) and one of its ends is within `TOLERANCE_NS` of the
keyframe; it closes the stretch of every meeting that it closes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from closers import TOLERANCE_NS

from objreg_ros.data.closures import LoopClosure
from objreg_tools.report.run.revisits import VIEW_CHANGES, Revisit, SeenPlace, revisit_of
from objreg_tools.truth import FALSE, LOOSE, Truths, within

APART_NS = 2_000_000_000
"""Meetings are of one stretch if no more time is between one and the next."""


@dataclass(frozen=True)
class Meeting:
    """A keyframe of robot ``later`` that saw what ``earlier`` had seen before; ``revisit`` goes from that one to it."""

    earlier: str
    later: str
    revisit: Revisit

    def is_tied_by(self, closure: LoopClosure) -> bool:
        """Whether a constraint ties the other robot to this keyframe, whichever of the two it calls *from*."""
        ends = ((closure.from_robot, closure.from_ns), (closure.to_robot, closure.to_ns))
        return any(
            robot == self.later and other == self.earlier and abs(stamp_ns - self.revisit.to_ns) <= TOLERANCE_NS
            for (robot, stamp_ns), (other, _) in (ends, ends[::-1])
        )


def meetings(seen: Mapping[str, Sequence[SeenPlace]]) -> list[Meeting]:
    """For every keyframe of every robot one meeting with each other robot that had seen its place before.

    ``seen`` has the keyframes of each robot by name; their true poses are in one world, and their stamps of one clock.
    """
    found = []
    for later, keyframes in seen.items():
        for earlier in (name for name in seen if name != later):
            for keyframe in keyframes:
                before = [other for other in seen[earlier] if other.stamp_ns < keyframe.stamp_ns]
                if (revisit := revisit_of(keyframe, before)) is not None:
                    found.append(Meeting(earlier, later, revisit))
    return found


def stretches(found: Iterable[Meeting]) -> list[list[Meeting]]:
    """The meetings of two robots that follow each other without `APART_NS` between them, in order of time."""
    parts: list[list[Meeting]] = []
    for meeting in sorted(found, key=lambda m: (m.later, m.earlier, m.revisit.to_ns)):
        last = parts[-1][-1] if parts else None
        same = last is not None and (last.later, last.earlier) == (meeting.later, meeting.earlier)
        if last is not None and same and meeting.revisit.to_ns - last.revisit.to_ns <= APART_NS:
            parts[-1].append(meeting)
        else:
            parts.append([meeting])
    return parts


def judged(found: Sequence[Meeting], closures: Iterable[LoopClosure], truths: Truths) -> dict[str, Any]:
    """What the constraints between robots are worth: how many are right and false, and what they close.

    ``keyframes`` are meetings and ``stretches`` runs of them, each as closed and of how many; ``view_change`` has the
    keyframes by degrees between the two views, and ``robots`` the stretches by ``EARLIER-LATER``.
    """
    between = [closure for closure in closures if closure.from_robot != closure.to_robot]
    errors = [(closure, error) for closure in between if (error := truths.error(closure)) is not None]
    right = [closure for closure, error in errors if within(error, LOOSE)]
    closed = {meeting: any(map(meeting.is_tied_by, right)) for meeting in found}
    parts = [(part[0], any(closed[meeting] for meeting in part)) for part in stretches(found)]
    pairs = sorted({(first.earlier, first.later) for first, _ in parts})
    return {
        "constraints": len(between),
        "true": len(right),
        "false": sum(not within(error, FALSE) for _, error in errors),
        "keyframes": _counted(closed.values()),
        "view_change": {
            f"{low}-{min(high, 180)}": _counted(closed[m] for m in found if low <= m.revisit.view_change_deg < high)
            for low, high in VIEW_CHANGES
        },
        "stretches": _counted(is_closed for _, is_closed in parts),
        "robots": {
            f"{a}-{b}": _counted(is_closed for first, is_closed in parts if (first.earlier, first.later) == (a, b))
            for a, b in pairs
        },
    }


def _counted(verdicts: Iterable[bool]) -> dict[str, int]:
    closed = list(verdicts)
    return {"closed": sum(closed), "of": len(closed)}
