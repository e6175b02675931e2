# SPDX-License-Identifier: Apache-2.0
"""What `objreg offline` writes of a run beside its JSON: the corrected map as files, and scenes for viewers."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import click

from objreg_ros.registrar.params import RegistrarParams
from objreg_tools.cli.verbosity import aside
from objreg_tools.recording import Recording
from objreg_tools.report.exports.map_files import MapFiles
from objreg_tools.report.exports.occupancy_grid import BAND_M, CELL_M, GridParams
from objreg_tools.report.exports.run_scene import scene_of
from objreg_tools.report.exports.scene_files import SceneFiles
from objreg_tools.report.run.pictures import Album
from objreg_tools.report.run.run_summary import RunSummary


@dataclass(frozen=True, slots=True)
class Outputs:
    """The files that are asked for. A file that a recording cannot give is refused before the long run."""

    files: MapFiles
    scenes: SceneFiles

    @classmethod
    def of(
        cls,
        tum: Path | None,
        kitti: Path | None,
        g2o: Path | None,
        cloud: Path | None,
        voxel: float,
        rerun: Path | None,
        mcap: Path | None,
        tum_before: Path | None = None,
        tum_truth: Path | None = None,
        cell: float = CELL_M,
        band: tuple[float, float] = BAND_M,
    ) -> Outputs:
        """Those of the options; a ``cloud`` without an ending is a folder. ValueError for a bad one."""
        is_folder = cloud is not None and (cloud.is_dir() or not cloud.suffix)
        file, folder = (None, cloud) if is_folder else (cloud, None)
        if folder is not None and folder.exists() and not folder.is_dir():
            raise ValueError(f"--map: expected a folder, or a file that ends with .ply, got the file {folder}")
        grid = GridParams(cell, *band)
        try:
            files = MapFiles(tum, kitti, g2o, file, voxel, tum_before, tum_truth, folder, grid)
        except ValueError as error:
            raise ValueError(f"--voxel: {error}") from error
        return cls(files, SceneFiles(rerun, mcap))

    @property
    def wanted(self) -> bool:
        """Whether any file is asked for."""
        return bool(self.files.wanted or self.scenes.wanted)

    def require_trajectory(self, source: Recording, has_trajectory: bool, has_truth: bool) -> None:
        """ValueError where nothing will give the trajectory: a map corrects one, a scene shows any.

        ``has_trajectory`` is whether there is odometry, or the registrar's own tracking in its place.
        """
        if self.files.wanted and not has_trajectory:
            there = ", ".join(source.topics)
            raise ValueError(
                f"{source.path}: {', '.join(self.files.wanted)}: expected a trajectory, which a map corrects, got "
                f"--odometry none; leave it out or take --odometry tracked, or one of {there} with --odometry TOPIC"
            )
        if self.files.tum_truth is not None and not has_truth:
            raise ValueError(
                f"{source.path}: --tum-truth: expected a ground truth in the recording, got none; leave it out, or "
                "name its topic with --remap ground_truth:=TOPIC"
            )
        self.scenes.require_trajectory(source.path, has_trajectory or has_truth)

    def remembering(self, registrar: RegistrarParams, folder: str) -> RegistrarParams:
        """With a store in a file, in ``folder`` unless it has one, where the map is made of its keyframes."""
        if (self.files.cloud is None and self.files.folder is None) or registrar.store:
            return registrar
        return registrar.replaced(store=str(Path(folder, "keyframes.db")))

    @aside()
    def write(self, run_summary: RunSummary, album: Album, store: Path) -> None:
        """Write what is asked for, and report it; nothing for a run of which no frame got through."""
        if not run_summary.glimpses:
            return
        if self.scenes.wanted:
            self.scenes.write(scene_of(run_summary, album), click.echo)
        if self.files.wanted:
            known, source = run_summary.map, "our own tracking" if run_summary.by_tracking else "odometry"
            click.echo(f"  map: {known.keyframes()} keyframes, {len(run_summary.pruned)} constraints pruned")
            if known.unsolved:
                click.echo(f"  map: as {source} says: {known.unsolved}")
            if run_summary.left_out:
                click.echo(f"  map: {run_summary.left_out} frames at which time does not advance are left out")
            self.files.write(run_summary, store, lambda line: click.echo(f"  map: {line}"))
