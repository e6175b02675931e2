# SPDX-License-Identifier: Apache-2.0
"""The corrected map of a run as files that other programs read: its trajectory, its pose graph and its cloud."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from objreg_mapper.formats import g2o, kitti, tum
from objreg_ros.data.checked import Array
from objreg_ros.whole_file import write_whole
from objreg_tools.report.exports.map_folder import add_keyframe, write_map_folder
from objreg_tools.report.exports.occupancy_grid import GridParams
from objreg_tools.report.exports.placed_keyframes import PlacedKeyframes
from objreg_tools.report.exports.ply import write_ply
from objreg_tools.report.exports.voxel_cloud import VOXEL_M, VoxelCloud, require_voxel
from objreg_tools.report.run.run_summary import RunSummary


@dataclass(frozen=True, slots=True)
class MapFiles:
    """Where what of a corrected map is written, None for nowhere; ``voxel`` m is the side of a voxel of ``cloud``.

    ``tum`` and ``kitti`` have the pose of the camera (optical frame) at every frame, ``tum_before`` that before the
    constraints correct it, ``tum_truth`` the true one where it is known, ``g2o`` the keyframes of the mapper with what
    ties them but the constraints that were pruned, and beside it their times, ``cloud`` (PLY) the views of the
    registrar's keyframes, ``folder`` what `write_map_folder` writes, by ``grid``. ValueError for a voxel that is none.
    """

    tum: Path | None = None
    kitti: Path | None = None
    g2o: Path | None = None
    cloud: Path | None = None
    voxel: float = VOXEL_M
    tum_before: Path | None = None
    tum_truth: Path | None = None
    folder: Path | None = None
    grid: GridParams = GridParams()

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
            "--map": self.cloud or self.folder,
        }
        return {option: file for option, file in files.items() if file is not None}

    def write(self, run: RunSummary, store: Path, notify: Callable[[str], None] = lambda line: None) -> None:
        """Write what is asked for; ``store`` is the registrar's, which is read for cloud and folder alone.

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
        placed = PlacedKeyframes(store, run.map.frames, by_odometry=not run.by_tracking)
        if self.folder is not None:
            for _ in write_map_folder(self.folder, placed, self.grid, self.voxel, notify):
                pass
        if self.cloud is not None:
            cloud = cloud_of(placed, self.voxel, notify)
            xyz, rgb = cloud.points()
            write_ply(self.cloud, xyz, rgb=rgb)
            notify(f"{self.cloud}: {len(xyz)} points, one for each voxel of {100.0 * cloud.voxel:g} cm")


def cloud_of(placed: PlacedKeyframes, voxel: float, notify: Callable[[str], None] = lambda line: None) -> VoxelCloud:
    """The views of keyframes, and their objects where these have colours, in the corrected frame.

    ``notify`` receives how many keyframes are left out, as those of another run in the same store.
    """
    cloud, left_out = VoxelCloud(voxel), 0
    for keyframe, T_map_camera in placed.all(notify):
        if T_map_camera is None:
            left_out += 1
            continue
        add_keyframe(cloud, keyframe, T_map_camera)
    if left_out:
        notify(
            f"{left_out} keyframes of the store are not on the map: they are of another run, or not of the trajectory"
        )
    if cloud.voxel > voxel:
        notify(f"voxels of {voxel:g} m are more than fit into memory")
    return cloud


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
