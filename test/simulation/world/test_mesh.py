# SPDX-License-Identifier: Apache-2.0
"""Solids: volumes, outward normals, texture coordinates, materials."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_tools.simulation.world.mesh import Material, Mesh, box, boxes, cushion, disc, merge, revolve, sheet, tube
from objreg_tools.simulation.world.model import turn

GREY = Material(np.full((4, 4, 3), 128, np.uint8))
RED = Material(np.full((8, 8, 3), (255, 0, 0), np.uint8))


def volume(mesh: Mesh) -> float:
    """The volume that a closed mesh encloses, by the divergence theorem: positive if its faces look outside."""
    P = mesh.vertices.astype(float)[mesh.faces]
    return float((P[:, 0] * np.cross(P[:, 1], P[:, 2])).sum() / 6)


def cylinder() -> Mesh:
    return revolve(np.array([(0, 0.3), (0.1, 0.3), (0.1, 0.0), (0, 0.0)]), GREY, segments=64)


SOLIDS = {
    "box": (box((0.2, 0.1, 0.4), GREY), 0.2 * 0.1 * 0.4),
    "cylinder": (cylinder(), np.pi * 0.01 * 0.3),
    "ball": (cushion((0.2, 0.2, 0.2), GREY, squareness=2.0), np.pi * 0.2**3 / 6),
    "bar": (tube(np.array([(0, 0, 0), (0, 0, 0.5)]), 0.02, GREY, segments=32), np.pi * 0.02**2 * 0.5),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_a_solid_has_its_volume_and_looks_outside(name: str) -> None:
    mesh, expected = SOLIDS[name]
    assert volume(mesh) == pytest.approx(expected, rel=0.06)


@pytest.mark.parametrize("name", SOLIDS)
def test_normals_have_length_1_and_agree_with_the_faces(name: str) -> None:
    mesh, _ = SOLIDS[name]
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-5)
    P = mesh.vertices[mesh.faces].astype(float)
    flat = np.cross(P[:, 1] - P[:, 0], P[:, 2] - P[:, 0])
    large = np.linalg.norm(flat, axis=1) > 1e-9
    assert ((flat * mesh.normals[mesh.faces].mean(axis=1)).sum(1)[large] > 0).mean() > 0.99


def test_a_box_stands_on_the_ground_with_its_pictures_upright() -> None:
    mesh = box((0.2, 0.1, 0.4), GREY, {"front": (0.0, 0.0, 0.5, 0.5)})
    np.testing.assert_allclose(mesh.bounds, [(-0.1, -0.05, 0.0), (0.1, 0.05, 0.4)], atol=1e-7)
    front = np.isclose(mesh.normals[:, 1], -1)
    top_left = mesh.vertices[front][mesh.uv[front].sum(1).argmin()]
    np.testing.assert_allclose(top_left, (-0.1, -0.05, 0.4), atol=1e-7)  # seen from -y, left is -x
    assert mesh.uv[front].max() == 0.5


def test_a_tiled_box_repeats_its_texture_by_length() -> None:
    assert box((2.0, 1.0, 0.5), GREY, tile=0.5).uv.max() == 4.0


def test_many_boxes_are_the_boxes_one_by_one() -> None:
    sizes = np.array([(0.1, 0.2, 0.3), (0.3, 0.1, 0.1)])
    feet = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.5)])
    together = boxes(sizes, feet, np.broadcast_to([0.0, 0.0, 1.0, 1.0], (2, 6, 4)), GREY)
    apart = merge([box(size, GREY).moved(*foot) for size, foot in zip(sizes, feet, strict=True)])
    np.testing.assert_allclose(together.vertices, apart.vertices, atol=1e-7)
    np.testing.assert_array_equal(together.faces, apart.faces)


def test_merging_keeps_equal_materials_once_and_every_face_its_own() -> None:
    mesh = merge([box((1, 1, 1), GREY), box((1, 1, 1), RED), box((1, 1, 1), GREY)])
    assert mesh.materials == (GREY, RED)
    assert [mesh.materials[m] for m in mesh.material[::12]] == [GREY, RED, GREY]
    assert mesh.faces.max() == len(mesh.vertices) - 1


def test_placing_turns_points_and_normals() -> None:
    mesh = disc(0.1, GREY).placed(turn("x", 90.0))
    np.testing.assert_allclose(mesh.normals, [[0, -1, 0]] * len(mesh.normals), atol=1e-6)
    assert np.ptp(mesh.vertices[:, 1]) < 1e-6


def test_a_scaled_normal_stays_at_a_right_angle() -> None:
    slope = sheet(np.array([[(0, 0, 1.0), (1, 0, 1.0)], [(0, -1, 0.0), (1, -1, 0.0)]]), GREY).scaled(1, 1, 3)
    P = slope.vertices.astype(float)
    along = P[2] - P[0]
    assert abs(along @ slope.normals[0]) < 1e-6


@pytest.mark.parametrize("shape", [(4, 4, 4), (4, 8, 3), (6, 6, 3)])
def test_a_texture_of_the_wrong_shape_is_refused_with_what_was_expected(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="power of two"):
        Material(np.zeros(shape, np.uint8))
