# SPDX-License-Identifier: Apache-2.0
"""The files in which viewers show a run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from objreg_tools.report.exports.mcap_file import write_mcap
from objreg_tools.report.exports.rerun_file import require_rerun, write_rerun
from objreg_tools.report.exports.run_scene import RunScene


@dataclass(frozen=True, slots=True)
class SceneFiles:
    """Where a run is written for ``rerun`` and for Foxglove (``mcap``), None for nowhere.

    ValueError, before the run, where the Rerun SDK is asked for and not installed.
    """

    rerun: Path | None = None
    mcap: Path | None = None

    def __post_init__(self) -> None:
        if self.rerun is not None:
            require_rerun()

    @property
    def wanted(self) -> dict[str, Path]:
        """The files that are asked for, by the names of their options."""
        files = {"--rerun": self.rerun, "--mcap": self.mcap}
        return {option: file for option, file in files.items() if file is not None}

    def require_trajectory(self, recording: Path, is_known: bool) -> None:
        """ValueError, before the run, where nothing will give the camera's pose."""
        if self.wanted and not is_known:
            raise ValueError(
                f"{recording}: {', '.join(self.wanted)}: expected odometry or a ground truth to show where the camera "
                "was, got neither; choose the topic of either with --remap, or leave the file out"
            )

    def write(self, scene: RunScene, notify: Callable[[str], object] = lambda line: None) -> None:
        """Write what is asked for; ``notify`` receives a line for each file. OSError where a file cannot be written."""
        if self.rerun is not None:
            notify(f"  {self.rerun}: {_said(scene, write_rerun(self.rerun, scene))}; open it with: rerun {self.rerun}")
        if self.mcap is not None:
            notify(f"  {self.mcap}: {_said(scene, write_mcap(self.mcap, scene))}; open it in Foxglove")


def _said(scene: RunScene, moments: int) -> str:
    trajectories = ", ".join(scene.trajectories)
    return f"the trajectory ({trajectories}), {len(scene.edges)} closures, {moments} frames with picture and cloud"
