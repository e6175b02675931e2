# SPDX-License-Identifier: Apache-2.0
"""A corrected map as a folder that a robot drives by: grid, cloud and landmarks, all in one frame whose z is up."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.whole_file import write_whole
from objreg_tools.report.exports.floor import Heights, upright
from objreg_tools.report.exports.landmark_places import as_geojson, landmark_places
from objreg_tools.report.exports.nav2_map import write_nav2_map
from objreg_tools.report.exports.occupancy_grid import FREE, OCCUPIED, GridMaker, GridParams, OccupancyGrid
from objreg_tools.report.exports.placed_keyframes import PlacedKeyframes
from objreg_tools.report.exports.ply import write_ply
from objreg_tools.report.exports.voxel_cloud import VoxelCloud

NAMES = ("map.pgm", "map.yaml", "map.ply", "landmarks.json")
OF_AN_OBJECT = 100.0  # weight of an object's colour over the grey of a reduced picture

Notify = Callable[[str], None]


def write_map_folder(
    folder: Path, placed: PlacedKeyframes, params: GridParams, voxel: float, notify: Notify = lambda line: None
) -> Iterator[Path]:
    """Write `NAMES` into ``folder``, which is made, and yield each file as it is written.

    Where gravity is not known, or no floor is seen, there is no grid, and ``notify`` receives why; without gravity the
    others stay in the frame of the map. OSError where a file cannot be written, StoreError (one of them) where the
    store cannot be read.
    """
    folder.mkdir(parents=True, exist_ok=True)
    T_level_map = level_of(placed)
    if T_level_map is None:
        notify("no keyframe of the map knows gravity: there is no grid, and z may not be up")
    elif not np.array_equal(T_level_map, np.eye(4)):
        turn = np.degrees(np.arccos(np.clip(T_level_map[2, 2], -1.0, 1.0)))
        notify(f"turned by {turn:.1f} degrees so that z is up: T_level_map in {folder / NAMES[3]}")
    grid = None if T_level_map is None else grid_of(placed, T_level_map, params, notify)
    if grid is not None:
        notify(f"{folder / NAMES[0]}: {_described(grid)}")
        yield from write_nav2_map(folder / NAMES[0], grid)
    T_level_map = np.eye(4) if T_level_map is None else T_level_map
    cloud = VoxelCloud(voxel)
    for keyframe, T_map_camera in placed:
        add_keyframe(cloud, keyframe, T_level_map @ T_map_camera)
    xyz, rgb = cloud.points()
    notify(f"{folder / NAMES[2]}: {len(xyz)} points, one for each voxel of {100.0 * cloud.voxel:g} cm")
    yield write_ply(folder / NAMES[2], xyz, rgb=rgb)
    places = landmark_places(placed, T_level_map)
    notify(f"{folder / NAMES[3]}: {len(places)} landmarks")
    write_whole(folder / NAMES[3], json.dumps(as_geojson(places, T_level_map), indent=1) + "\n")
    yield folder / NAMES[3]


def level_of(placed: Iterable[tuple[Keyframe, Array]]) -> Array | None:
    """``T_level_map (4, 4)`` that turns a map upright; None where no keyframe knows gravity."""
    return upright((T_map_camera, keyframe.gravity, keyframe.gravity_confidence) for keyframe, T_map_camera in placed)


def grid_of(
    placed: PlacedKeyframes, T_level_map: Array, params: GridParams, notify: Notify = lambda line: None
) -> OccupancyGrid | None:
    """The grid of a map that ``T_level_map (4, 4)`` turns upright; None, with the reason, where no floor is seen."""
    heights, cameras = Heights(), list[Array]()
    for keyframe, T_map_camera in placed:
        heights.add_view(T_level_map @ T_map_camera, keyframe.view)
        cameras.append((T_level_map @ T_map_camera)[:3, 3])
    floor = heights.floor()
    if floor is None:
        notify("no keyframe of the map sees a floor: there is no grid")
        return None
    below = float(np.median([camera[2] for camera in cameras])) - floor
    notify(f"the floor is at z = {floor:.2f} m, {below:.2f} m below the camera")
    maker = GridMaker(np.array(cameras), floor, params)
    for keyframe, T_map_camera in placed:
        maker.add_view(T_level_map @ T_map_camera, keyframe.view)
    return maker.grid()


def add_keyframe(cloud: VoxelCloud, keyframe: Keyframe, T_map_camera: Array) -> None:
    """Add the view of a keyframe, and its objects where these have colours."""
    grey = keyframe.view.grey
    cloud.add_points(T_map_camera, keyframe.view.xyz, None if grey is None else np.repeat(grey[..., None], 3, axis=2))
    for item in keyframe.objects:
        if item.cloud.rgb is not None:
            cloud.add_points(T_map_camera, item.cloud.xyz, item.cloud.rgb, OF_AN_OBJECT)


def _described(grid: OccupancyGrid) -> str:
    height, width = grid.cells.shape
    area = grid.cell**2
    free, occupied = (area * float((grid.cells == value).sum()) for value in (FREE, OCCUPIED))
    return f"{width} x {height} cells of {100.0 * grid.cell:g} cm, {free:.1f} m^2 free, {occupied:.1f} m^2 occupied"
