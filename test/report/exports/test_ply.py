# SPDX-License-Identifier: Apache-2.0
"""PLY files hold what was written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import open3d
import pytest
from registration.samples import box

from objreg_tools.report.exports.ply import write_ply
from report.ply_reader import positions, read_ply


def test_points_normals_and_colours_are_written(tmp_path: Path) -> None:
    item = box("cup", (0, 0, 1))
    table = read_ply(write_ply(tmp_path / "a.ply", item.xyz, item.normals, item.rgb))
    assert np.array_equal(positions(table), item.xyz)
    assert np.array_equal(table["nz"], item.normals[:, 2]) and np.array_equal(table["red"], item.rgb[:, 0])
    assert "red" not in (read_ply(write_ply(tmp_path / "b.ply", item.xyz, item.normals, None)).dtype.names or ())


def test_open3d_reads_what_is_written_to_the_last_bit(tmp_path: Path) -> None:
    item, far = box("cup", (0, 0, 1)), np.array([450_000.0, 5_400_000.0, 0.0])
    cloud = open3d.io.read_point_cloud(str(write_ply(tmp_path / "a.ply", item.xyz + far, item.normals, item.rgb)))
    assert np.array_equal(np.asarray(cloud.points), item.xyz + far)
    assert np.array_equal(np.asarray(cloud.normals), item.normals)
    assert np.array_equal(np.round(255.0 * np.asarray(cloud.colors)), item.rgb)


def test_a_cloud_without_points_is_written_too(tmp_path: Path) -> None:
    assert len(read_ply(write_ply(tmp_path / "a.ply", np.zeros((0, 3)), np.zeros((0, 3)), None))) == 0


def test_a_full_disk_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "full.ply").symlink_to("/dev/full")
    item = box("cup", (0, 0, 1))
    with pytest.raises(OSError, match="No space left"):
        write_ply(tmp_path / "full.ply", item.xyz, item.normals, item.rgb)


def test_normals_are_left_out_where_there_are_none(tmp_path: Path) -> None:
    assert read_ply(write_ply(tmp_path / "a.ply", np.zeros((2, 3)))).dtype.names == ("x", "y", "z")
