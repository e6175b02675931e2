# SPDX-License-Identifier: Apache-2.0
"""What a running graph published last, in bounded memory, as JSON and as a picture. Knows no ROS."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import ObjectCloud
from objreg_ros.data.images import Detections, Intrinsics
from objreg_tools.cli.watching.reports import NodeReport
from objreg_tools.cli.watching.thinned import Point, Thinned
from objreg_tools.report.live_pictures import sight
from objreg_tools.report.stage_times import in_order

RECENT = 50  # closures and refusals that are shown
MOST_POINTS = 2000  # of a trajectory
MOST_EDGES = 2000  # lines between keyframes
MOST_OBJECTS = 500
MOST_NODES = 32
QUALITY = 80  # of the JPEG
TEXT = 300  # characters of a text of another node that are shown


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """One frame as the graph saw it; objects are drawn where the camera is known."""

    rgb: Array
    detections: Detections
    objects: Sequence[ObjectCloud] = ()
    camera: Intrinsics | None = None


class Watched:
    """Takes in from the thread that listens, and is read by those that answer."""

    def __init__(self) -> None:
        self._lock, self._began_s = threading.Lock(), time.monotonic()
        self._first_ns: int | None = None  # the first stamp that was seen
        self._nodes: dict[str, NodeReport] = {}
        self._counts: dict[str, str] = {}  # of the registrar
        self._rejected: dict[str, int] = {}
        self._closures: deque[dict[str, Any]] = deque(maxlen=RECENT)
        self._refusals: deque[dict[str, Any]] = deque(maxlen=RECENT)
        self._odometry = Thinned(MOST_POINTS)
        self._corrected: list[Point] = []
        self._edges: dict[str, list[Point]] = {}
        self._objects: list[tuple[str, Point]] = []
        self._sight: Sight | None = None
        self._drawn: tuple[int, bytes] | None = None

    def report(self, node: str, made: NodeReport) -> None:
        """A node reported its counters; a registrar its refusals by reason too, and what it stores."""
        with self._lock:
            if node in self._nodes or len(self._nodes) < MOST_NODES:
                self._nodes[node] = made
            self._rejected.update(made.rejected)
            self._counts.update(made.counts)

    def accept(self, stamps_ns: tuple[int, int], labels: Sequence[str], evidence: Mapping[str, float]) -> None:
        """A constraint between the keyframes of two stamps was published."""
        names = ", ".join(dict.fromkeys(labels))[:TEXT]
        row = {"from_ns": str(stamps_ns[0]), "to_ns": str(stamps_ns[1]), "labels": names}
        with self._lock:
            self._closures.append({**row, "score": evidence.get("score"), "odds": evidence.get("odds")})
            self._begin(min(stamps_ns))

    def _begin(self, stamp_ns: int) -> None:
        self._first_ns = stamp_ns if self._first_ns is None else self._first_ns

    def refuse(self, stamps_ns: tuple[int, int], reason: str, detail: str) -> None:
        """A candidate was refused."""
        row = {"from_ns": str(stamps_ns[0]), "to_ns": str(stamps_ns[1]), "reason": reason, "detail": detail[:TEXT]}
        with self._lock:
            self._refusals.append(row)
            self._begin(min(stamps_ns))

    def move(self, position: Point) -> None:
        """The odometry has the body here, (x, y, z) m."""
        if all(map(np.isfinite, position)):
            with self._lock:
                self._odometry.add(position)

    def correct(self, positions: Sequence[Point]) -> None:
        """The mapper has corrected the whole trajectory."""
        step = 1 + len(positions) // MOST_POINTS
        with self._lock:
            self._corrected = list(positions[::step])

    def place(self, edges: Mapping[str, Sequence[Point]], objects: Sequence[tuple[str, Point]]) -> None:
        """The registrar's markers: lines between keyframes, two points each, by name, and objects by theirs."""
        with self._lock:
            self._edges = {name: list(points[-2 * MOST_EDGES :]) for name, points in edges.items()}
            self._objects = list(objects[-MOST_OBJECTS:])

    def see(self, seen: Sight) -> None:
        """A picture with what was found in it."""
        with self._lock:
            self._sight = seen
            self._begin(seen.detections.stamp_ns)

    def as_json(self) -> dict[str, Any]:
        """Everything but the picture, which ``picture`` names by its stamp, as text; None without one.

        ``began`` is the first stamp of all, from which the page counts its times.
        """
        with self._lock:
            return {
                "seconds": round(time.monotonic() - self._began_s),
                "began": None if self._first_ns is None else str(self._first_ns),
                "nodes": [_node(name, made) for name, made in sorted(self._nodes.items())],
                "counts": dict(self._counts),
                "rejected": dict(sorted(self._rejected.items(), key=lambda item: -item[1])),
                "closures": list(reversed(self._closures)),
                "refusals": list(reversed(self._refusals)),
                "odometry": _flat(self._odometry),
                "corrected": _flat(self._corrected),
                "edges": {name: _flat(points) for name, points in self._edges.items()},
                "objects": [[name[:TEXT], *_flat([position])[0]] for name, position in self._objects],
                "picture": None if self._sight is None else str(self._sight.detections.stamp_ns),
            }

    def picture(self) -> bytes | None:
        """The last picture as JPEG, drawn once; None without one."""
        with self._lock:
            seen, drawn = self._sight, self._drawn
        if seen is None:
            return None
        stamp_ns = seen.detections.stamp_ns
        if drawn is None or drawn[0] != stamp_ns:
            rgb = sight(seen.rgb, seen.camera, seen.detections, seen.objects)
            encoded = cv2.imencode(".jpg", np.ascontiguousarray(rgb[..., ::-1]), [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1]
            drawn = stamp_ns, encoded.tobytes()
            with self._lock:
                self._drawn = drawn
        return drawn[1]


def _node(name: str, made: NodeReport) -> dict[str, Any]:
    balance = made.balance
    return {
        "name": name,
        "received": balance.received,
        "published": balance.published,
        "waiting": balance.waiting,
        "dropped": balance.dropped,
        "warns": made.warns,
        "silent": made.is_silent(),
        "message": made.message[:TEXT],
        "stages": [[f"{stage}{part}", *times] for part, stage, times in in_order(balance.stage_ms)],
    }


def _flat(points: Thinned | Sequence[Point]) -> list[list[float]]:
    """From above, in mm."""
    return [[round(float(value), 3) for value in point[:2]] for point in points]
