# SPDX-License-Identifier: Apache-2.0
"""Which frames are still in flight through the graph, by the `finished` acknowledgements of its nodes. Knows no ROS.

An acknowledgement is a Header: the stamp of the frame, and ``"<node> published"`` or ``"<node> dropped <reason>"``. By
``"<node> followed"`` a frame goes on, and its end comes later.
Colour and depth of a frame may have stamps of their own, so they are followed apart: an image until the detector is
done with it, depth until the last node is.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection

ORDER = ("detector", "segmenter", "registrar")  # the nodes that a frame passes through, in order
DETECTOR = ORDER[0]
IMAGE, DEPTH = "image", "depth"


class Acknowledgements:
    """The images and depths that were sent and have not come to their end.

    ``nodes`` are those that are there. Depth is through when the last of them published or dropped it, or when one
    before it dropped it. What no node acknowledgements is never waited for.
    """

    def __init__(self, nodes: Collection[str]) -> None:
        self.nodes = [node for node in ORDER if node in nodes]
        if not self.nodes:
            raise ValueError(f"expected one of {', '.join(ORDER)}, got {', '.join(sorted(nodes)) or 'no nodes'}")
        self.outcomes: defaultdict[str, Counter[str]] = defaultdict(Counter)
        self._followed = {IMAGE: DETECTOR in self.nodes, DEPTH: self.nodes[-1] != DETECTOR}
        self._in_flight: dict[str, Counter[int]] = {IMAGE: Counter(), DEPTH: Counter()}

    def waiting(self, kind: str, after_ns: int | None = None) -> int:
        """How many images or depths are in flight, of all or of those later than a stamp."""
        stamps = self._in_flight[kind].elements()
        return sum(after_ns is None or stamp > after_ns for stamp in stamps)

    def send(self, kind: str, stamp_ns: int) -> None:
        """An image or a depth was sent."""
        if self._followed[kind]:
            self._in_flight[kind][stamp_ns] += 1

    def read_acknowledgement(self, text: str, stamp_ns: int) -> None:
        """An acknowledgement came; one that says nothing we know is left aside."""
        node, _, verdict = text.partition(" ")
        is_dropped = verdict.startswith("dropped")
        if node not in ORDER or not (is_dropped or verdict == "published"):
            return
        self.outcomes[node][verdict] += 1
        kind = IMAGE if node == DETECTOR else DEPTH
        ends = node in (DETECTOR, self.nodes[-1]) or is_dropped
        if ends and self._in_flight[kind][stamp_ns] > 0:
            self._in_flight[kind][stamp_ns] -= 1

    def give_up(self) -> list[int]:
        """Wait no longer for anything; the stamps of what never came to its end."""
        lost = sorted(stamp for kind in self._in_flight.values() for stamp in kind.elements())
        for kind in self._in_flight.values():
            kind.clear()
        return lost
