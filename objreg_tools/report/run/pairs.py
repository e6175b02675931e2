# SPDX-License-Identifier: Apache-2.0
"""Every pair of keyframes that a run accepted or refused, as a row of a table."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from objreg_ros.data.closures import UNTRIED, LoopClosure, Rejected
from objreg_ros.geometry import rotation_angle
from objreg_tools.report.run.run_summary import RunSummary
from objreg_tools.truth import Error

ACCEPTED = "accepted"


@dataclass(frozen=True)
class PairRow:
    """A constraint or a refusal. ``key`` names it on the page, within its run."""

    key: str
    outcome: LoopClosure | Rejected
    run: RunSummary

    @property
    def verdict(self) -> str:
        """Accepted, false or refused: its CSS class."""
        if isinstance(self.outcome, Rejected):
            return "refused"
        return "false" if self.run.is_false(self.outcome) else ACCEPTED

    @property
    def reason(self) -> str:
        """Why it was refused, `ACCEPTED` where it was not."""
        return self.outcome.reason.value if isinstance(self.outcome, Rejected) else ACCEPTED

    @property
    def tried(self) -> bool:
        """Whether something was registered."""
        return isinstance(self.outcome, LoopClosure) or self.outcome.reason not in UNTRIED

    @property
    def labels(self) -> tuple[str, ...]:
        """What closed it, each once; of a refusal what was detected in both frames."""
        if isinstance(self.outcome, LoopClosure):
            return tuple(dict.fromkeys(self.outcome.labels))
        return self.run.seen_at_both(self.outcome.from_ns, self.outcome.to_ns)

    @property
    def seconds(self) -> tuple[float, float]:
        """Both times since the run began, s."""
        return self.run.seconds(self.outcome.from_ns), self.run.seconds(self.outcome.to_ns)

    @cached_property
    def error(self) -> Error | None:
        """Degrees and centimetres by which the pose is wrong; None without truth or without a pose."""
        return self.run.truth.error(self.outcome)

    @property
    def text(self) -> str:
        """Which cameras saw it, where they are two; the numbers behind a refusal, what moved, and the true error."""
        if isinstance(self.outcome, Rejected):
            parts = [self.outcome.detail]
        else:
            parts = [f"{label} moved by {metres:.2f} m" for label, metres in self.outcome.moved.items()]
        return ". ".join(part for part in (self._cameras, *parts, self._in_truth) if part)

    @property
    def _cameras(self) -> str:
        """The two cameras, with their robots; empty where one camera saw both, and where it is not known."""
        outcome = self.outcome
        ends = (outcome.from_robot, outcome.from_frame_id), (outcome.to_robot, outcome.to_frame_id)
        first, then = ("/".join(filter(None, (robot, frame_id))) for robot, frame_id in ends)
        return f"{first}, then {then}" if first and then and first != then else ""

    @property
    def _in_truth(self) -> str:
        """How far the two cameras are apart, and by how much the pose is wrong; empty without truth."""
        truth = self.run.truth.between(self.outcome.from_ns, self.outcome.to_ns)
        if truth is None or self.outcome.from_ns == self.outcome.to_ns:
            return ""
        degrees, metres = np.degrees(rotation_angle(truth[:3, :3])), float(np.linalg.norm(truth[:3, 3]))
        apart = f"In truth {degrees:.0f}° and {metres:.1f} m apart"
        off = "" if self.error is None else f"; the pose is off by {self.error[0]:.1f}° and {self.error[1]:.1f} cm"
        return f"{apart}{off}."


def pairs_of(run: RunSummary) -> list[PairRow]:
    """All constraints (keys c0, c1, …) and then all refusals (r0, r1, …) of a run, in the order of its JSON."""
    items: Iterable[tuple[str, LoopClosure | Rejected]] = (
        *((f"c{k}", closure) for k, closure in enumerate(run.closures)),
        *((f"r{k}", refusal) for k, refusal in enumerate(run.refusals)),
    )
    return [PairRow(key, item, run) for key, item in items]


def by_interest(pairs: Iterable[PairRow]) -> list[PairRow]:
    """False constraints first, then right ones, refused poses, what was tried without one, and the rest."""
    ranks = {"false": 0, ACCEPTED: 1, "refused": 2}
    return sorted(pairs, key=lambda pair: (not pair.tried, pair.outcome.T_from_to is None, ranks[pair.verdict]))
