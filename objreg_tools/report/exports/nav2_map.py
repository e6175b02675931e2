# SPDX-License-Identifier: Apache-2.0
"""A grid as Nav2's map_server reads it: a picture, and a YAML beside it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from objreg_ros.whole_file import write_whole
from objreg_tools.report.exports.occupancy_grid import FREE, OCCUPIED, OccupancyGrid

GREY = {FREE: 254, OCCUPIED: 0}
UNKNOWN_GREY = 205
OCCUPIED_THRESH = 0.65
FREE_THRESH = 0.196  # below (255 - 205) / 255: with Nav2's own 0.25 what is unknown would be read as free


def write_nav2_map(picture: Path, grid: OccupancyGrid) -> tuple[Path, Path]:
    """Write ``picture`` (PGM) and a YAML of its name beside it; both paths. OSError where they cannot be written.

    Row 0 of the picture is the top, which has the largest y; the origin of the YAML is the lower left corner of the
    lower left pixel, as x, y and yaw.
    """
    grey = np.full(grid.cells.shape, UNKNOWN_GREY, np.uint8)
    for value, shade in GREY.items():
        grey[grid.cells == value] = shade
    rows, columns = grid.cells.shape[0], grid.cells.shape[1]
    write_whole(picture, f"P5\n{columns} {rows}\n255\n".encode() + grey[::-1].tobytes())
    facts = picture.with_suffix(".yaml")
    write_whole(facts, yaml_text(picture.name, grid))
    return picture, facts


def yaml_text(picture: str, grid: OccupancyGrid) -> str:
    """What map_server has to know of the ``picture``, a file beside the YAML."""
    x, y = (round(value, 6) for value in grid.origin)
    return (
        f"image: {json.dumps(picture)}\nmode: trinary\nresolution: {grid.cell:.6g}\norigin: [{x:.6f}, {y:.6f}, 0.0]\n"
        f"negate: 0\noccupied_thresh: {OCCUPIED_THRESH}\nfree_thresh: {FREE_THRESH}\n"
    )
