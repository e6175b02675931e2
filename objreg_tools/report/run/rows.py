# SPDX-License-Identifier: Apache-2.0
"""The rows in the JSON of a run: its frames, closures and refusals."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from objreg_ros.data import closure_fields
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure, Rejected
from objreg_ros.data.frames import Odometry
from objreg_tools.report.run.camera_map import TrackedFrame

Row = TypeVar("Row")

MOST_NS = 1 << 63
OUTLINE = re.compile(r"(\d{1,5},\d{1,5}( \d{1,5},\d{1,5}){2,})?")


@dataclass(frozen=True, slots=True)
class Glimpse:
    """One frame: when, from where (None without odometry), the labels detected, and objects by label and position.

    Positions (3,) are the middles of the objects in the camera, m.
    """

    stamp_ns: int
    T_odom_camera: Array | None = None
    labels: tuple[str, ...] = ()
    tracked: tuple[int, Array] | None = None  # without odometry: session and T_session_camera by our own tracking
    objects: tuple[tuple[str, Array], ...] = ()
    outlines: tuple[str, ...] = ()  # of the objects, one each or none at all: `objreg_tools.offline.outlines`

    def pose(self, by_tracking: bool) -> tuple[int, Array] | None:
        """The session and ``T_session_camera`` of our own tracking, or of odometry; None where there is none."""
        if by_tracking:
            return self.tracked
        return None if self.T_odom_camera is None else (0, self.T_odom_camera)


def advancing(glimpses: Sequence[Glimpse], by_tracking: bool = False) -> list[tuple[Glimpse, TrackedFrame]]:
    """The frames with a pose that are later than all before them: stamps repeat and go back where a bag is looped.

    ``by_tracking``: the pose is that of our own tracking, else that of odometry, whose one session is 0.
    """
    later: list[tuple[Glimpse, TrackedFrame]] = []
    for glimpse in glimpses:
        known = glimpse.pose(by_tracking)
        if known is not None and (not later or glimpse.stamp_ns > later[-1][0].stamp_ns):
            later.append((glimpse, TrackedFrame(glimpse.stamp_ns, *known)))
    return later


def read_rows(name: str, summary: Mapping[str, Any], key: str, read: Callable[[Any], Row]) -> tuple[Row, ...]:
    """The rows of a key; none where it is missing. ValueError that names the run where one is not as it should be."""
    try:
        return tuple(read(row) for row in summary.get(key, ()))
    except (TypeError, KeyError, AttributeError, ValueError, OverflowError) as error:
        got = " ".join(str(summary[key]).split())[:80]
        raise ValueError(
            f"{name}: expected {key} as `objreg offline --json` writes them, got {got} ({error!r}); run it again"
        ) from error


def glimpse_of(row: Mapping[str, Any]) -> Glimpse:
    """A frame; ValueError where it is none."""
    pose, stamp_ns, tracked = row.get("T_odom_camera"), _stamp(row["stamp_ns"]), row.get("tracked")
    return Glimpse(
        stamp_ns=stamp_ns,
        T_odom_camera=None if pose is None else _rigid(pose, stamp_ns),
        labels=tuple(map(_spaced, row.get("labels", ()))),
        tracked=None if tracked is None else (int(tracked["session"]), _rigid(tracked["T_session_camera"], stamp_ns)),
        objects=tuple((_spaced(label), _place(xyz)) for label, xyz in row.get("objects", ())),
        outlines=_outlines(row.get("outlines", ()), len(row.get("objects", ()))),
    )


def _stamp(value: Any) -> int:
    """A stamp in ns; ValueError for what a message cannot have."""
    stamp_ns = int(value)
    if abs(stamp_ns) >= MOST_NS:
        raise ValueError(f"expected a stamp in ns, got {value}")
    return stamp_ns


def _place(xyz: Any) -> Array:
    """A position (3,) m; ValueError if it is none."""
    place = np.array(xyz, float)
    if place.shape != (3,) or not np.isfinite(place).all():
        raise ValueError(f"expected three finite numbers, got {xyz}")
    return place


def _outlines(rows: Sequence[str], count: int) -> tuple[str, ...]:
    """The outlines of so many objects; ValueError for what would not be drawn."""
    if len(rows) not in (0, count) or not all(OUTLINE.fullmatch(row) for row in rows):
        raise ValueError(f"expected no outlines or {count}, each of corners u,v; got {str(rows)[:60]}")
    return tuple(rows)


def _rigid(pose: Any, stamp_ns: int) -> Array:
    """The pose (4, 4); ValueError if it is none."""
    return Odometry(T_odom_body=np.array(pose, float), stamp_ns=stamp_ns).T_odom_body


def closure_of(row: Mapping[str, Any]) -> LoopClosure:
    """A closure with its labels as they read on a page; ValueError where it is none."""
    closure = closure_fields.closure_of(row)
    return replace(closure, labels=tuple(map(_spaced, closure.labels)), evidence=_spaced_names(closure.evidence))


def refusal_of(row: Mapping[str, Any]) -> Rejected:
    """A refused pair; ValueError where it is none."""
    rejected = closure_fields.rejected_of(row)
    return replace(rejected, evidence=_spaced_names(rejected.evidence))


def _spaced_names(evidence: Mapping[str, float]) -> dict[str, float]:
    return {_spaced(name): number for name, number in evidence.items()}


def _spaced(label: str) -> str:
    """A label as it reads on a page."""
    return label.replace("_", " ")
