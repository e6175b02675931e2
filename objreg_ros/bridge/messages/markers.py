# SPDX-License-Identifier: Apache-2.0
"""What the registrar knows, as RViz shows it: objects with names, accepted and rejected edges between keyframes."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from typing import Any

from geometry_msgs.msg import Point
from numpy.typing import NDArray
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from objreg_ros.bridge.messages import to_msg
from objreg_ros.data.closures import LoopClosure, Rejected
from objreg_ros.data.frames import Frame

Array = NDArray[Any]

RECENT_FRAMES = 1000  # frames whose position is remembered until it is known which is a keyframe
MOST_PLACES = 20_000  # keyframes whose position is remembered for the edges that end there
RECENT_CLOSURES, RECENT_REFUSALS = 2000, 100  # edges that are shown
GREEN, RED, GOLD, WHITE = (0.2, 0.8, 0.3, 1.0), (0.9, 0.2, 0.2, 0.35), (1.0, 0.75, 0.1, 0.9), (1.0, 1.0, 1.0, 1.0)

Edge = tuple[int, int]


class MarkerScene:
    """Where the camera was at its keyframes, and which of them were joined. Frames without odometry have no place."""

    def __init__(self) -> None:
        self._recent: deque[tuple[int, Array]] = deque(maxlen=RECENT_FRAMES)
        self._places: dict[int, Array] = {}
        self._accepted: deque[Edge] = deque(maxlen=RECENT_CLOSURES)
        self._rejected: deque[Edge] = deque(maxlen=RECENT_REFUSALS)

    def see(self, frame: Frame) -> None:
        """Remember where the camera was."""
        if frame.T_odom_camera is not None:
            self._recent.append((frame.stamp_ns, frame.T_odom_camera[:3, 3]))

    def show_keyframe(self, keyframe_ns: int) -> None:
        """A frame became a keyframe."""
        self._places.update(item for item in tuple(self._recent) if item[0] == keyframe_ns)
        while len(self._places) > MOST_PLACES:
            del self._places[next(iter(self._places))]

    def join(self, closures: Iterable[LoopClosure], rejected: Iterable[Rejected]) -> bool:
        """Add edges between keyframes, which may come long after these; whether there are any."""
        accepted = [(closure.from_ns, closure.to_ns) for closure in closures]
        refused = [(refusal.from_ns, refusal.to_ns) for refusal in rejected if refusal.from_ns != refusal.to_ns]
        self._accepted += accepted
        self._rejected += refused
        return bool(accepted or refused)

    def part(self, withdrawn: Iterable[LoopClosure]) -> bool:
        """Take the edges of withdrawn closures away; whether there were any."""
        gone = {(closure.from_ns, closure.to_ns) for closure in withdrawn}
        kept = [edge for edge in self._accepted if edge not in gone]
        changed = len(kept) < len(self._accepted)
        self._accepted = deque(kept, maxlen=self._accepted.maxlen)
        return changed

    def clear(self) -> None:
        """Forget everything."""
        self.__init__()  # type: ignore[misc]

    def markers(self, objects: Sequence[tuple[int, str, Array]], stamp_ns: int, frame_id: str) -> MarkerArray:
        """Everything at once; ``objects`` are (id, label, position (3,)) in ``frame_id``."""
        head = to_msg.header(stamp_ns, frame_id)
        made = [
            Marker(header=head, action=Marker.DELETEALL),
            _lines(head, "accepted", self._ends(self._accepted), GREEN, 0.015),
            _lines(head, "rejected", self._ends(self._rejected), RED, 0.005),
        ]
        for number, label, position in objects:
            made += [_ball(head, number, position), _name(head, number, f"{label} {number}", position)]
        return MarkerArray(markers=made)

    def _ends(self, edges: Iterable[Edge]) -> list[Point]:
        known = [edge for edge in edges if edge[0] in self._places and edge[1] in self._places]
        return [_point(self._places[stamp_ns]) for edge in known for stamp_ns in edge]


def closures(kept: Array, pruned: Array, residuals: Array, stamp_ns: int, frame_id: str) -> MarkerArray:
    """Closures as lines between two places, (m, 2, 3) and (n, 2, 3); at those that are pruned their residuals."""
    head = to_msg.header(stamp_ns, frame_id)
    made = [
        Marker(header=head, action=Marker.DELETEALL),
        _lines(head, "kept", [_point(xyz) for xyz in kept.reshape(-1, 3)], GREEN, 0.015),
        _lines(head, "pruned", [_point(xyz) for xyz in pruned.reshape(-1, 3)], RED, 0.01),
    ]
    for number, (ends, residual) in enumerate(zip(pruned, residuals, strict=True)):
        made.append(_name(head, number, f"{residual:.3g}", ends.mean(axis=0)))
    return MarkerArray(markers=made)


def _point(xyz: Array) -> Point:
    x, y, z = (float(value) for value in xyz)
    return Point(x=x, y=y, z=z)


def _marker(head: Any, space: str, number: int, kind: int, colour: tuple[float, ...], size: float) -> Marker:
    marker = Marker(header=head, ns=space, id=number, type=kind, action=Marker.ADD)
    marker.scale.x = marker.scale.y = marker.scale.z = size
    marker.color = ColorRGBA(r=colour[0], g=colour[1], b=colour[2], a=colour[3])
    marker.pose.orientation.w = 1.0
    return marker


def _lines(head: Any, space: str, points: list[Point], colour: tuple[float, ...], width: float) -> Marker:
    marker = _marker(head, space, 0, Marker.LINE_LIST, colour, width)
    marker.points = points
    return marker


def _ball(head: Any, number: int, position: Array) -> Marker:
    marker = _marker(head, "objects", number, Marker.SPHERE, GOLD, 0.06)
    marker.pose.position = _point(position)
    return marker


def _name(head: Any, number: int, text: str, position: Array) -> Marker:
    marker = _marker(head, "names", number, Marker.TEXT_VIEW_FACING, WHITE, 0.07)
    marker.pose.position = _point(position)
    marker.pose.position.z += 0.08
    marker.text = text
    return marker
