# SPDX-License-Identifier: Apache-2.0
"""The corrected map of a run as files that other programs read: its trajectory, its pose graph and its cloud."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from objreg_mapper.formats import g2o, kitti, tum
from objreg_ros.data.checked import Array
from objreg_ros.memory.store import Store
from objreg_ros.memory.store_file import StoreError
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.whole_file import write_whole
from objreg_tools.report.exports.ply import write_ply
from objreg_tools.report.exports.voxel_cloud import VoxelCloud, require_voxel
from objreg_tools.report.run.run_summary import RunSummary

VOXEL_M = 0.02  # finer than what a depth camera errs by at 2 m
OF_AN_OBJECT = 100.0  # weight of an object's colour over the grey of a reduced picture
SAME_POSE = 1e-6  # m, and of the entries of a rotation


@dataclass(frozen=True, slots=True)
class MapFiles:
    """Where what of a corrected map is written, None for nowhere; ``voxel`` m is the side of a voxel of ``cloud``.

    ``tum`` and ``kitti`` have the pose of the camera (optical frame) at every frame, ``tum_before`` that before the
    constraints correct it, ``tum_truth`` the true one where it is known, ``g2o`` the keyframes of the mapper with what
    ties them but the constraints that were pruned, and beside it their times, ``cloud`` (PLY) the views of the
    registrar's keyframes. ValueError for a voxel that is none.
    """

    tum: Path | None = None
    kitti: Path | None = None
    g2o: Path | None = None
    cloud: Path | None = None
    voxel: float = VOXEL_M
    tum_before: Path | None = None
    tum_truth: Path | None = None

    def __post_init__(self) -> None:
        require_voxel(self.voxel)

    @property
    def wanted(self) -> dict[str, Path]:
        """The files that are asked for, by the names of their options."""
        files = {
            "--tum": self.tum,
            "--tum-before": self.tum_before,
            "--tum-truth": self.tum_truth,
            "--kitti": self.kitti,
            "--g2o": self.g2o,
            "--map": self.cloud,
        }
        return {option: file for option, file in files.items() if file is not None}

    def write(self, run: RunSummary, store: Path, notify: Callable[[str], None] = lambda line: None) -> None:
        """Write what is asked for; ``store`` is the registrar's, which is read for the cloud alone.

        ``notify`` receives what was written and what was left out. ValueError for a run without a trajectory: it has no
        map. OSError where a file cannot be written, StoreError (one of them) where the store cannot be read.
        """
        stamps, before, corrected = run.poses_before_and_after()
        if not stamps:
            raise ValueError(f"{', '.join(self.wanted)}: {_why_no_map(run)}")
        trajectories = (
            (self.tum, list(zip(stamps, corrected, strict=True))),
            (self.tum_before, list(zip(stamps, before, strict=True))),
            (self.tum_truth, list(_true(run, stamps))),
        )
        for file, trajectory in trajectories:
            if file is not None:
                write_whole(file, tum.trajectory_text(trajectory))
                notify(f"{file}: {len(trajectory)} poses")
        if self.kitti is not None:
            write_whole(self.kitti, kitti.trajectory_text(corrected))
            notify(f"{self.kitti}: {len(stamps)} poses")
        if self.g2o is not None:
            keyframes, edges = run.graph.flat(left_out=run.pruned)
            times = g2o.times_file(self.g2o)
            write_whole(times, g2o.times_text(run.graph.flat_times()))
            write_whole(self.g2o, g2o.graph_text(keyframes, edges))
            notify(f"{self.g2o}: {len(keyframes)} keyframes, {len(edges)} edges; their times in {times.name}")
        if self.cloud is not None:
            poses = {frame.stamp_ns: (frame.T_session_camera, frame.T_map_camera) for frame in run.map.frames}
            cloud = cloud_of(_keyframes(store, notify), poses, self.voxel, notify, by_odometry=not run.by_tracking)
            xyz, rgb = cloud.points()
            write_ply(self.cloud, xyz, rgb=rgb)
            notify(f"{self.cloud}: {len(xyz)} points, one for each voxel of {100.0 * cloud.voxel:g} cm")


def cloud_of(
    keyframes: Iterator[Keyframe],
    poses: dict[int, tuple[Array, Array]],
    voxel: float,
    notify: Callable[[str], None] = lambda line: None,
    by_odometry: bool = True,
) -> VoxelCloud:
    """The views of keyframes, and their objects where these have colours, in the corrected frame.

    ``poses`` are ``T_session_camera`` and ``T_map_camera`` by stamps, by odometry or by our own tracking. A keyframe
    that is not of one of them, as one of another run in the same store, is left out.
    """
    cloud, left_out = VoxelCloud(voxel), 0
    for keyframe in keyframes:
        T_map_camera = _corrected(keyframe, poses) if keyframe.by_odometry == by_odometry else None
        if T_map_camera is None:
            left_out += 1
            continue
        grey = keyframe.view.grey
        cloud.add_points(
            T_map_camera, keyframe.view.xyz, None if grey is None else np.repeat(grey[..., None], 3, axis=2)
        )
        for item in keyframe.objects:
            if item.cloud.rgb is not None:
                cloud.add_points(T_map_camera, item.cloud.xyz, item.cloud.rgb, OF_AN_OBJECT)
    if left_out:
        notify(
            f"{left_out} keyframes of the store are not on the map: they are of another run, or not of the trajectory"
        )
    if cloud.voxel > voxel:
        notify(f"voxels of {voxel:g} m are more than fit into memory")
    return cloud


def _corrected(keyframe: Keyframe, poses: dict[int, tuple[Array, Array]]) -> Array | None:
    """``T_map_camera``; None for a keyframe that is not of this run."""
    T_session_camera, T_map_camera = poses.get(keyframe.stamp_ns, (None, None))
    if T_session_camera is None or keyframe.T_odom_camera is None:
        return None
    return T_map_camera if np.allclose(keyframe.T_odom_camera, T_session_camera, rtol=0.0, atol=SAME_POSE) else None


def _true(run: RunSummary, stamps_ns: Iterable[int]) -> Iterator[tuple[int, Array]]:
    """The stamps that truth covers, with ``T_world_camera`` at each."""
    return ((stamp, T) for stamp in stamps_ns if (T := run.truth.at(stamp)) is not None)


def _why_no_map(run: RunSummary) -> str:
    if run.by_tracking:
        return f"expected frames that were tracked, got none of {len(run.glimpses)}: there is no map"
    return (
        f"expected frames with odometry, got none of {len(run.glimpses)}: there is no map; is the topic of the "
        "odometry the right one, and its stamps of the same clock (odom_slop)? --odometry tracked does without"
    )


def _keyframes(path: Path, notify: Callable[[str], None]) -> Iterator[Keyframe]:
    """The keyframes of a store, the oldest first; those that are damaged are left out and reported."""
    store = Store(path, read_only=True)
    try:
        for keyframe_id in store.keyframe_ids():
            try:
                keyframe = store.keyframe(keyframe_id)
            except StoreError as error:
                notify(f"keyframe {keyframe_id} is left out: {error}")
                continue
            yield keyframe
    finally:
        store.close()
