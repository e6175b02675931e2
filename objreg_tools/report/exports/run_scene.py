# SPDX-License-Identifier: Apache-2.0
"""A run in 3D, for viewers: trajectories of the camera, closures, objects, and camera views."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.images import DepthImage, Intrinsics
from objreg_ros.geometry import back_project, rigid_fit
from objreg_tools.report.run.pictures import Album
from objreg_tools.report.run.run_summary import RunSummary, positions

WIDTH = 320  # px of a picture
MOST_POINTS = 6000  # of a cloud
MOST_MOMENTS = 200  # with picture and cloud
FARTHEST_M = 6.0  # what is farther errs by decimetres
LEAST_COMMON = 3  # poses that truth and map must share for their alignment


@dataclass(frozen=True, slots=True, eq=False)
class ShownTrajectory:
    """Where the camera was: ``poses (N, 4, 4)`` in the frame of the map at ``stamps_ns``, which rise."""

    stamps_ns: tuple[int, ...]
    poses: Array

    @property
    def positions(self) -> Array:
        """(N, 3) m."""
        return np.asarray(self.poses[:, :3, 3])


@dataclass(frozen=True, slots=True, eq=False)
class ClosureEdge:
    """A closure between two places, ``ends (2, 3)`` m, with its labels and true error as text.

    ``verdict`` is ``accepted``, ``pruned`` by the mapper, or ``false`` where truth says so.
    """

    closure: LoopClosure
    ends: Array
    verdict: str
    text: str


@dataclass(frozen=True, slots=True, eq=False)
class SceneFrame:
    """The view of a ``camera`` at one time: ``rgb (H, W, 3)``, and points ``xyz (N, 3)`` m in it with ``colours``."""

    stamp_ns: int
    T_map_camera: Array
    camera: Intrinsics
    rgb: Array
    xyz: Array
    colours: Array


@dataclass(frozen=True, eq=False)
class RunScene:
    """A run in the frame in which odometry began: ``trajectories`` are ``odometry``, ``corrected`` and ``true``.

    ``tracked`` stands for ``odometry`` where the trajectory is that of our own tracking. Without either, the one
    trajectory is the true one, in the frame of the truth. ``objects`` are labels with positions (3,) m, one for each
    frame that saw one.
    """

    name: str
    trajectories: Mapping[str, ShownTrajectory]
    edges: tuple[ClosureEdge, ...]
    objects: tuple[tuple[str, Array], ...]
    album: Album

    @property
    def main(self) -> ShownTrajectory:
        """The trajectory on which the camera is shown."""
        return self.trajectories["corrected"] if "corrected" in self.trajectories else self.trajectories["true"]

    def moments(self) -> Iterator[SceneFrame]:
        """The views at evenly spread times; those whose picture cannot be read are left out."""
        trajectory = self.main
        count = len(trajectory.stamps_ns)
        for k in np.unique(np.linspace(0, count - 1, min(count, MOST_MOMENTS)).round().astype(int)).tolist():
            image = self.album.at(trajectory.stamps_ns[k])
            if image is not None and image.rgb is not None:
                yield _moment(image, image.rgb, trajectory.stamps_ns[k], trajectory.poses[k])


def scene_of(run: RunSummary, album: Album) -> RunScene:
    """The scene of a run; ValueError where neither odometry nor truth gives the camera's pose."""
    trajectories = _trajectories(run)
    if not trajectories:
        raise ValueError(f"{run.name}: expected odometry or a ground truth to show where the camera was, got neither")
    scene = RunScene(run.name, trajectories, (), tuple((label, xyz) for label, _, xyz in run.objects()), album)
    return RunScene(run.name, trajectories, _edges(run, scene.main), scene.objects, album)


def _trajectories(run: RunSummary) -> dict[str, ShownTrajectory]:
    stamps, odometry, corrected = run.poses_before_and_after()
    if not run.has_trajectory:
        return _true_trajectory(run, [glimpse.stamp_ns for glimpse in run.glimpses] or run.truth.stamps_ns)
    trajectories = {name: ShownTrajectory(tuple(stamps), np.array(poses)) for name, poses in
            ((run.source, odometry), ("corrected", corrected))}  # fmt: skip
    true = _true_trajectory(run, stamps).get("true")
    if true is not None and len(true.stamps_ns) >= LEAST_COMMON:
        of = dict(zip(stamps, corrected, strict=True))
        T_map_truth = rigid_fit(true.positions, positions([of[stamp] for stamp in true.stamps_ns]))
        trajectories["true"] = ShownTrajectory(true.stamps_ns, T_map_truth @ true.poses)
    return trajectories


def _true_trajectory(run: RunSummary, stamps_ns: list[int]) -> dict[str, ShownTrajectory]:
    known = {stamp: T for stamp in sorted(set(stamps_ns)) if (T := run.truth.at(stamp)) is not None}
    return {"true": ShownTrajectory(tuple(known), np.array(list(known.values())))} if known else {}


def _edges(run: RunSummary, trajectory: ShownTrajectory) -> tuple[ClosureEdge, ...]:
    """The closures with both stamps on the trajectory, at the nearest of its poses."""
    stamps, places = np.array(trajectory.stamps_ns), trajectory.positions
    pruned = set(map(id, run.pruned))
    edges = []
    for closure in run.closures:
        if min(closure.from_ns, closure.to_ns) < stamps[0] or max(closure.from_ns, closure.to_ns) > stamps[-1]:
            continue
        ends = places[[int(np.abs(stamps - stamp).argmin()) for stamp in (closure.from_ns, closure.to_ns)]]
        verdict = "false" if run.is_false(closure) else "pruned" if id(closure) in pruned else "accepted"
        edges.append(ClosureEdge(closure, ends, verdict, _text(run, closure)))
    return tuple(edges)


def _text(run: RunSummary, closure: LoopClosure) -> str:
    error = run.error(closure)
    off = "" if error is None else f": off by {error[0]:.1f}°, {error[1]:.1f} cm"
    return f"{', '.join(closure.labels)}{off}"


def _moment(image: DepthImage, rgb: Array, stamp_ns: int, T_map_camera: Array) -> SceneFrame:
    camera = image.intrinsics
    step = max(1, round((image.depth.size / MOST_POINTS) ** 0.5))
    at = np.s_[step // 2 :: step, step // 2 :: step]
    xyz = back_project(image.depth, camera.fx, camera.fy, camera.cx, camera.cy)[at]
    seen = (image.depth[at] > 0) & (image.depth[at] < FARTHEST_M)
    reduced = max(1, camera.width // WIDTH)
    small = camera.scaled(reduced)
    return SceneFrame(
        stamp_ns=stamp_ns,
        T_map_camera=T_map_camera,
        camera=small,
        rgb=cv2.resize(np.ascontiguousarray(rgb), (small.width, small.height), interpolation=cv2.INTER_AREA),
        xyz=xyz[seen].astype(np.float32),
        colours=rgb[at][seen],
    )
