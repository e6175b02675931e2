# SPDX-License-Identifier: Apache-2.0
"""A grid as other programs read it: PyYAML and OpenCV, by the rules of Nav2's map_io.cpp."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import yaml

from objreg_tools.report.exports.nav2_map import write_nav2_map
from objreg_tools.report.exports.occupancy_grid import FREE, OCCUPIED, UNKNOWN, GridMaker, GridParams, OccupancyGrid
from report.exports.drawn_flat import see, walk


def load(facts: Path) -> tuple[np.ndarray, dict[str, object]]:
    """The data of the nav_msgs/OccupancyGrid that map_server would publish, row 0 first, and what the YAML says."""
    said = yaml.safe_load(facts.read_text())
    picture = cv2.imread(str(facts.parent / said["image"]), cv2.IMREAD_GRAYSCALE)
    assert picture is not None and said["mode"] == "trinary" and said["negate"] == 0 and len(said["origin"]) == 3
    occupancy = np.float32(1.0) - picture.astype(np.float32) / np.float32(255.0)
    data = np.full(picture.shape, UNKNOWN, np.int8)
    data[occupancy >= said["occupied_thresh"]] = OCCUPIED
    data[occupancy <= said["free_thresh"]] = FREE
    return data[::-1], said


def test_what_is_read_is_what_was_written_row_by_row(tmp_path: Path) -> None:
    cells = np.array([[FREE, OCCUPIED, UNKNOWN], [UNKNOWN, FREE, FREE]], np.int8)
    picture, facts = write_nav2_map(tmp_path / "map.pgm", OccupancyGrid(cells, (-1.25, 2.0), 0.05))
    data, said = load(facts)
    assert data.tolist() == cells.tolist()
    assert said["origin"] == [-1.25, 2.0, 0.0] and said["resolution"] == 0.05 and said["image"] == "map.pgm"
    assert picture.read_bytes() == b"P5\n3 2\n255\n" + bytes([205, 254, 254, 254, 0, 205])


def test_a_robot_that_reads_the_flat_finds_its_walls_and_its_opening(tmp_path: Path) -> None:
    poses = walk()
    maker = GridMaker(np.array([T[:3, 3] for T in poses]), 0.0, GridParams())
    for T in poses:
        maker.add_view(T, see(T))
    data, said = load(write_nav2_map(tmp_path / "map.pgm", maker.grid())[1])
    x, y, yaw = said["origin"]  # type: ignore[misc]

    def at(xy: tuple[float, float]) -> int:
        return int(data[int((xy[1] - y) / said["resolution"]), int((xy[0] - x) / said["resolution"])])

    assert yaw == 0.0
    assert [at((x, 3.025)) for x in (0.5, 1.5, 2.5)] == [OCCUPIED, FREE, OCCUPIED]
    assert [at((1.5, y)) for y in (-0.025, 0.5, 2.9, 3.2, 5.0, 6.025)] == [OCCUPIED, FREE, FREE, FREE, FREE, OCCUPIED]
