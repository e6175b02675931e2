# SPDX-License-Identifier: Apache-2.0
"""What is written is what the readers of KITTI trajectories expect."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from objreg_mapper.formats.kitti import trajectory_text

from .blank import QUARTER_LEFT


def test_a_line_has_the_upper_three_rows_of_its_pose_one_after_the_other() -> None:
    first, second = trajectory_text([np.eye(4), QUARTER_LEFT]).splitlines()
    assert np.array_equal(np.array(first.split(), float), [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0])
    np.testing.assert_allclose(np.array(second.split(), float), [0, -1, 0, 1, 1, 0, 0, 2, 0, 0, 1, 3], atol=1e-9)


def test_no_poses_are_an_empty_file() -> None:
    assert trajectory_text([]) == ""


def test_evo_reads_the_poses_that_were_written(tmp_path: Path) -> None:
    interface = pytest.importorskip("evo.tools.file_interface", reason="evo is not installed")
    (tmp_path / "way.kitti").write_text(trajectory_text([np.eye(4), QUARTER_LEFT]))
    read = interface.read_kitti_poses_file(tmp_path / "way.kitti")
    np.testing.assert_allclose(read.poses_se3, [np.eye(4), QUARTER_LEFT], atol=1e-8)
