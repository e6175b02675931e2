# SPDX-License-Identifier: Apache-2.0
"""The revisits that there were in a recording by its truth, and which of them a run closed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import ceil, sqrt
from typing import Any

import numpy as np

from objreg_ros import limits
from objreg_ros.data.checked import Array
from objreg_ros.data.frames import View
from objreg_ros.data.images import DepthImage
from objreg_ros.geometry import back_project, inverse, rotation_angle
from objreg_tools.report.run.pictures import Album
from objreg_tools.report.run.revisits import Revisit, SeenPlace, revisits
from objreg_tools.truth import LOOSE, Truth, within

GAP_NS = 2_000_000_000  # what is nearer in time is no loop, as the registrar's default has it
TOLERANCE_NS = 1_000_000_000  # a keyframe spans up to a second
APART = (0.15, 8.0)  # m, degrees: as often as the registrar makes keyframes by default
MOST_PLACES = 400  # each is held against each; of a longer recording they are farther apart
VIEW_PIXELS = 160 * 120


def revisits_in(truth: Truth, album: Album) -> list[Revisit]:
    """The revisits of a recording, by its true path and its depth; none without truth."""
    places = []
    for stamp_ns in _stamps(truth):
        seen = album.at(stamp_ns)
        T_world_camera = None if seen is None else truth.at(seen.stamp_ns)
        if seen is not None and T_world_camera is not None:
            places.append(SeenPlace(seen.stamp_ns, _view(seen), T_world_camera))
    return revisits(places, GAP_NS)


def closed_of(found: Sequence[Revisit], summary: Mapping[str, Any]) -> tuple[int, int]:
    """How many of the revisits a run closed, of how many that its frames reached; by the run's JSON.

    One is closed where a constraint that is right (5 degrees, 10 cm) ends within `TOLERANCE_NS` of it.
    """
    last_ns = max((row["stamp_ns"] for row in summary["glimpses"]), default=0)
    ends = np.array(sorted(max(one["from_ns"], one["to_ns"]) for one in _right(summary["constraints"])), np.int64)
    reached = [one for one in found if one.to_ns <= last_ns]
    return sum(bool((np.abs(ends - one.to_ns) <= TOLERANCE_NS).any()) for one in reached), len(reached)


def _right(constraints: Iterable[Mapping[str, Any]]) -> Iterable[Mapping[str, Any]]:
    for one in constraints:
        error = one["error"]
        if error is not None and within((error["rotation_deg"], error["translation_cm"]), LOOSE):
            yield one


def _stamps(truth: Truth) -> list[int]:
    """The times of the true path at which the camera has moved on by `APART`, `MOST_PLACES` at most."""
    kept: list[int] = []
    last: Array | None = None
    for stamp_ns, T_world_camera in zip(truth.stamps_ns, truth.poses, strict=True):
        if last is None or _is_apart(inverse(last) @ T_world_camera):
            kept.append(stamp_ns)
            last = T_world_camera
    return kept[:: max(1, ceil(len(kept) / MOST_PLACES))]


def _is_apart(T_a_b: Array) -> bool:
    turn_deg = np.degrees(rotation_angle(T_a_b[:3, :3]))
    return bool(np.linalg.norm(T_a_b[:3, 3]) >= APART[0] or turn_deg >= APART[1])


def _view(seen: DepthImage) -> View:
    """A depth image at about `VIEW_PIXELS`."""
    step = max(1, round(sqrt(seen.depth.size / VIEW_PIXELS)))
    camera, rows = seen.intrinsics.scaled(step), slice(step // 2, None, step)
    xyz = back_project(seen.depth[rows, rows].astype(np.float32), camera.fx, camera.fy, camera.cx, camera.cy)
    z = xyz[..., 2:]
    xyz = np.where((z >= limits.LEAST_RANGE) & (np.abs(xyz) < limits.MOST_RANGE).all(-1, keepdims=True), xyz, np.nan)
    return View(xyz=xyz.astype(np.float32), grey=None, intrinsics=camera)
