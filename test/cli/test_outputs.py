# SPDX-License-Identifier: Apache-2.0
"""What is asked of a run beside its JSON is refused before the run where nothing can come of it."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from objreg_ros.registrar.params import RegistrarParams
from objreg_tools.cli.outputs import Outputs


def asked(folder: Path, *options: str, voxel: float = 0.02) -> Outputs:
    files = {option: folder / option for option in options}
    names = ("tum", "kitti", "g2o", "cloud")
    of_map = (files.get(name) for name in names)
    return Outputs.of(*of_map, voxel, None, files.get("mcap"), files.get("before"), files.get("truth"))


BAG: Any = SimpleNamespace(path=Path("bag"), topics={"/image": None})


def test_nothing_is_wanted_of_no_options(tmp_path: Path) -> None:
    assert not asked(tmp_path).wanted
    assert asked(tmp_path, "tum").wanted and asked(tmp_path, "mcap").wanted


def test_a_voxel_that_is_none_is_refused_by_the_name_of_its_option(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="--voxel: expected"):
        asked(tmp_path, "cloud", voxel=-1.0)


def test_a_map_wants_a_trajectory_and_says_how_to_get_one(tmp_path: Path) -> None:
    asked(tmp_path, "tum").require_trajectory(BAG, has_trajectory=True, has_truth=False)
    with pytest.raises(ValueError, match=r"--tum: expected a trajectory.*--odometry none.*--odometry tracked"):
        asked(tmp_path, "tum").require_trajectory(BAG, has_trajectory=False, has_truth=True)


def test_a_true_trajectory_wants_a_ground_truth(tmp_path: Path) -> None:
    asked(tmp_path, "truth").require_trajectory(BAG, has_trajectory=True, has_truth=True)
    asked(tmp_path, "before").require_trajectory(BAG, has_trajectory=True, has_truth=False)
    with pytest.raises(ValueError, match="--tum-truth: expected a ground truth in the recording, got none"):
        asked(tmp_path, "truth").require_trajectory(BAG, has_trajectory=True, has_truth=False)


def test_a_scene_is_content_with_truth(tmp_path: Path) -> None:
    outputs = asked(tmp_path, "mcap")
    outputs.require_trajectory(BAG, has_trajectory=False, has_truth=True)
    with pytest.raises(ValueError, match="--mcap: expected odometry or a ground truth"):
        outputs.require_trajectory(BAG, has_trajectory=False, has_truth=False)


def test_a_cloud_is_made_of_a_store_in_a_file(tmp_path: Path) -> None:
    usual, own = RegistrarParams(), RegistrarParams(store="mine.db")
    assert asked(tmp_path, "tum").remembering(usual, "folder").store == ""
    assert asked(tmp_path, "cloud").remembering(usual, "folder").store == "folder/keyframes.db"
    assert asked(tmp_path, "cloud").remembering(own, "folder").store == "mine.db"


def test_nothing_is_written_of_a_run_without_frames(tmp_path: Path) -> None:
    run_summary: Any = SimpleNamespace(glimpses=())
    asked(tmp_path, "tum", "mcap").write(run_summary, None, Path("store"))  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())
