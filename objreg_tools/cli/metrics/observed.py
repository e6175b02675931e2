# SPDX-License-Identifier: Apache-2.0
"""What the nodes of a running graph reported last, and since when each registrar closed no loop. Knows no ROS."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass

from objreg_tools.cli.watching.reports import NodeReport

MOST_NODES = 256


@dataclass(frozen=True, slots=True)
class Observation:
    """A node's last report. ``closed_s`` is the monotonic time at which its closures were seen to grow; None before."""

    report: NodeReport
    closed_s: float | None = None

    @property
    def closures(self) -> int | None:
        """The constraints that a registrar published; None for another node."""
        counted = self.report.counts.get("constraints")
        return None if counted is None else int(counted)

    def since_closure_s(self) -> float | None:
        """Seconds since the last closure; None where none was seen."""
        return None if self.closed_s is None else time.monotonic() - self.closed_s


class Observed:
    """Takes in from the thread that listens, and is read by those that answer."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._nodes: dict[str, Observation] = {}

    def report(self, node: str, report: NodeReport) -> None:
        """A node reported; ValueError where its number of closures is none. Nodes past MOST_NODES are passed over."""
        now = Observation(report).closures  # ValueError before anything is kept
        with self._lock:
            before = self._nodes.get(node)
            if before is None:
                if len(self._nodes) < MOST_NODES:
                    self._nodes[node] = Observation(report)
                return
            has_closed = _grew(before.closures, now)
            self._nodes[node] = Observation(report, report.at_s if has_closed else before.closed_s)

    def nodes(self) -> dict[str, Observation]:
        """The last observation of each node, sorted by name."""
        with self._lock:
            return dict(sorted(self._nodes.items()))


def _grew(before: int | None, now: int | None) -> bool:
    """Whether a closure came between two reports. A count that fell is of a node that began anew, at 0."""
    before, now = before or 0, now or 0
    return now > (before if now >= before else 0)
