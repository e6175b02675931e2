# SPDX-License-Identifier: Apache-2.0
"""The rasteriser against ray geometry that is known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.data.images import Intrinsics
from objreg_tools.simulation.rendering.light import looking
from objreg_tools.simulation.rendering.raster import rasterise
from objreg_tools.simulation.world.mesh import Material, box, cushion, merge

CAMERA = Intrinsics(fx=131.25, fy=140.0, cx=79.5, cy=59.5, width=160, height=120)
GREY = Material(np.full((4, 4, 3), 128, np.uint8))
UP = np.array([0.0, 0.0, 1.0])


def cast_on_plane(T: np.ndarray, camera: Intrinsics, normal: np.ndarray, offset: float) -> np.ndarray:
    """Depth (H, W) along the optical axis at which pixels see the plane normal·p = offset of the world."""
    v, u = np.mgrid[0 : camera.height, 0 : camera.width]
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones_like(u, float)], -1)
    return (offset - normal @ T[:3, 3]) / (rays @ (T[:3, :3].T @ normal))


def test_the_floor_has_the_depth_of_the_plane_to_a_tenth_of_a_millimetre() -> None:
    floor = box((40.0, 40.0, 1.0), GREY).moved(z=-1.0)
    T = looking(np.array([0.3, -1.0, 1.2]), np.array([0.0, 0.4, 0.0]), UP)
    depth, _ = rasterise(floor.vertices, floor.faces, floor.open_surface, T, CAMERA)
    np.testing.assert_allclose(depth, cast_on_plane(T, CAMERA, UP, 0.0), rtol=1e-4)


def test_a_plane_that_passes_under_the_camera_is_cut_at_the_near_plane() -> None:
    floor = box((40.0, 40.0, 1.0), GREY).moved(z=-1.0)
    T = looking(np.array([0.0, 0.0, 0.5]), np.array([5.0, 0.0, 0.4]), UP)
    depth, triangle = rasterise(floor.vertices, floor.faces, floor.open_surface, T, CAMERA)
    expected = cast_on_plane(T, CAMERA, UP, 0.0)
    hit = triangle >= 0
    assert hit[-1].all() and not hit[0].any()
    np.testing.assert_allclose(depth[hit], expected[hit], rtol=1e-4)


def test_the_nearer_of_two_surfaces_wins_whatever_the_order() -> None:
    far, near = box((2.0, 0.1, 2.0), GREY).moved(y=2.0, z=-1.0), box((0.4, 0.1, 0.4), GREY).moved(y=1.0, z=-0.2)
    T = looking(np.zeros(3), np.array([0.0, 1.0, 0.0]), UP)
    images = []
    for parts in ([far, near], [near, far]):
        mesh = merge(parts)
        images.append(rasterise(mesh.vertices, mesh.faces, mesh.open_surface, T, CAMERA)[0])
    np.testing.assert_array_equal(images[0], images[1])
    assert images[0][60, 80] == pytest.approx(0.95, abs=1e-4) and images[0][60, 20] == pytest.approx(1.95, abs=1e-4)


def test_a_closed_surface_of_many_triangles_has_no_cracks() -> None:
    ball = cushion((1.0, 1.0, 1.0), GREY, squareness=2.0)
    T = looking(np.array([0.0, -1.4, 0.52]), np.array([0.0, 0.0, 0.5]), UP)
    depth, _ = rasterise(ball.vertices, ball.faces, ball.open_surface, T, CAMERA)
    for row in depth:
        columns = np.flatnonzero(row)
        assert len(columns) == 0 or (row[columns[0] : columns[-1] + 1] > 0).all()


def test_the_back_of_a_face_is_seen_only_where_the_surface_is_open() -> None:
    wall = np.array([(-1, 1, -1), (1, 1, -1), (1, 1, 1), (-1, 1, 1)], np.float32)
    towards, away = np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.array([[2, 1, 0], [3, 2, 0]], np.int32)
    T = looking(np.zeros(3), np.array([0.0, 1.0, 0.0]), UP)
    seen = {}
    for name, faces in (("towards", towards), ("away", away)):
        for is_open in (False, True):
            seen[name, is_open] = (rasterise(wall, faces, np.full(2, is_open), T, CAMERA)[1] >= 0).any()
    assert seen == {("towards", False): True, ("towards", True): True, ("away", False): False, ("away", True): True}


def test_what_is_behind_the_camera_is_not_seen() -> None:
    mesh = box((1.0, 1.0, 1.0), GREY).moved(y=-3.0)
    T = looking(np.zeros(3), np.array([0.0, 1.0, 0.0]), UP)
    depth, triangle = rasterise(mesh.vertices, mesh.faces, mesh.open_surface, T, CAMERA)
    assert not depth.any() and (triangle == -1).all()
