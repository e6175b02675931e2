# SPDX-License-Identifier: Apache-2.0
"""A corrected map as a folder: its files agree on where things are."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from registration.samples import SECOND, box, keyframe

from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store import Store
from objreg_tools.report.exports.map_folder import NAMES, grid_of, level_of, write_map_folder
from objreg_tools.report.exports.occupancy_grid import FREE, OCCUPIED, GridParams
from objreg_tools.report.exports.placed_keyframes import PlacedKeyframes
from objreg_tools.report.run.camera_map import MappedFrame
from report.exports.drawn_flat import looking, see, walk
from report.exports.test_nav2_map import load
from report.ply_reader import positions, read_ply

FIRST = looking(1.5, 1.0, 90.0)  # the map is in the frame of this camera, as without odometry


def placed(path: Path, poses: list[Array], with_gravity: bool = True) -> PlacedKeyframes:
    store, frames = Store(path), []
    for k, T_world_camera in enumerate(poses, start=1):
        T = inverse(FIRST) @ T_world_camera
        made = replace(
            keyframe(k, k, (box("cup", (0.0, 0.0, 1.0)),), T_odom_camera=T),
            view=see(T_world_camera),
            gravity=T_world_camera[:3, :3].T @ np.array([0.0, 0.0, -1.0]) if with_gravity else None,
            gravity_confidence=1.0 if with_gravity else 0.0,
        )
        store.write_keyframe(made, sightings_of(made))
        frames.append(MappedFrame(k * SECOND, T, T, T))
    store.close()
    return PlacedKeyframes(path, tuple(frames))


@pytest.fixture(scope="module")
def flat(tmp_path_factory: pytest.TempPathFactory) -> PlacedKeyframes:
    return placed(tmp_path_factory.mktemp("flat") / "flat.db", walk())


def test_grid_cloud_and_landmarks_are_in_one_frame_whose_z_is_up(flat: PlacedKeyframes, tmp_path: Path) -> None:
    lines: list[str] = []
    written = list(write_map_folder(tmp_path / "map", flat, GridParams(), 0.05, lines.append))
    assert [file.name for file in written] == list(NAMES)
    data, said = load(tmp_path / "map" / "map.yaml")
    x, y, _ = said["origin"]  # type: ignore[misc]

    def at(
        world_x: float, world_y: float
    ) -> int:  # the map begins at the first camera, which looks along the world's y
        return int(data[int((world_y - 1.0 - y) / 0.05), int((world_x - 1.5 - x) / 0.05)])

    assert [at(x, 3.025) for x in (0.5, 1.5, 2.5)] == [OCCUPIED, FREE, OCCUPIED]
    xyz = positions(read_ply(tmp_path / "map" / "map.ply"))
    assert xyz[:, 2].min() == pytest.approx(-1.3, abs=0.05)
    np.testing.assert_allclose([xyz[:, 0].min(), xyz[:, 1].max()], [-1.5, 5.0], atol=0.05)
    features = json.loads((tmp_path / "map" / "landmarks.json").read_text())["features"]
    assert len(features) == 0 or all(item["properties"]["label"] == "cup" for item in features)
    assert any("turned by" in line for line in lines) and any("the floor is at z = -1.30 m" in line for line in lines)


def test_without_gravity_there_is_no_grid_and_the_rest_stays_where_it_was(tmp_path: Path) -> None:
    lines: list[str] = []
    blind = placed(tmp_path / "a.db", walk()[:2], with_gravity=False)
    written = list(write_map_folder(tmp_path / "map", blind, GridParams(), 0.05, lines.append))
    assert [file.name for file in written] == ["map.ply", "landmarks.json"] and level_of(blind) is None
    assert lines[0] == "no keyframe of the map knows gravity: there is no grid, and z may not be up"
    assert json.loads(written[1].read_text())["T_level_map"] == np.eye(4).tolist()


def test_without_a_floor_there_is_no_grid(tmp_path: Path) -> None:
    lines: list[str] = []
    above = placed(tmp_path / "a.db", [looking(1.5, 1.0, 90.0, down_deg=-30.0)])
    level = level_of(above)
    assert level is not None and grid_of(above, level, GridParams(), lines.append) is None
    assert lines == ["no keyframe of the map sees a floor: there is no grid"]


def test_a_map_of_no_keyframe_is_an_empty_cloud(tmp_path: Path) -> None:
    written = list(write_map_folder(tmp_path / "map", placed(tmp_path / "a.db", []), GridParams(), 0.05))
    assert len(read_ply(written[0])) == 0 and json.loads(written[1].read_text())["features"] == []
