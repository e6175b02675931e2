# SPDX-License-Identifier: Apache-2.0
"""Tests of silhouettes."""

from __future__ import annotations

import numpy as np

from objreg_ros.geometry import inverse, transform
from objreg_ros.registration.shapes.silhouette import BESIDE, INSIDE, RIM, Silhouette, draw
from registration.drawn_shapes import BOX, from_side, keyframe

NEAR = ((0.35, -0.2, 0.0), (0.4, 0.0, 0.3))  # stands between the camera and the left half of the box


def drawn(things: dict) -> Silhouette:
    key = keyframe(from_side(0.0), things, noise=0.0)
    xyz = key.objects[0].cloud.xyz
    return draw(xyz, np.zeros(len(xyz), np.float32), key.view)


def at(silhouette: Silhouette, point: tuple[float, float, float]) -> tuple[int, float, float]:
    """(mask, depth there, depth of the point) of a point in the world."""
    x, y, z = transform(inverse(from_side(0.0)), np.array(point))
    fx, fy, cx, cy = silhouette.camera
    row, column = int(fy * y / z + cy), int(fx * x / z + cx)
    return int(silhouette.mask[row, column]), float(silhouette.depth[row, column]), float(z)


def test_inside_is_the_object_and_beside_is_what_is_behind() -> None:
    silhouette = drawn({"box": BOX})
    mask, depth, z = at(silhouette, (0.10, 0.0, 0.12))
    assert mask == INSIDE and abs(depth - z) < 0.005
    mask, depth, z = at(silhouette, (0.0, 0.055, 0.2))
    assert mask == BESIDE and depth > z + 0.1
    assert (silhouette.mask == RIM).any()


def test_gaps_between_points_are_closed() -> None:
    key = keyframe(from_side(0.0), {"box": BOX}, noise=0.0)
    xyz = key.objects[0].cloud.xyz
    few = xyz[np.random.default_rng(0).permutation(len(xyz))[: len(xyz) // 2]]
    silhouette = draw(few, np.zeros(len(few), np.float32), key.view)
    assert at(silhouette, (0.10, 0.0, 0.12))[0] == INSIDE
    assert at(silhouette, (0.10, 0.02, 0.2))[0] == INSIDE


def test_what_stands_in_front_hides_and_is_not_free_space() -> None:
    silhouette = drawn({"box": BOX, "near": (NEAR,)})
    mask, depth, z = at(silhouette, (0.10, -0.035, 0.03))
    assert mask == BESIDE and 0.0 < depth < z


def test_every_pixel_knows_the_way_into_the_outline() -> None:
    silhouette = drawn({"box": BOX})
    rows, columns = np.indices(silhouette.mask.shape)
    to_row, to_column = rows + silhouette.inward[..., 1], columns + silhouette.inward[..., 0]
    assert (silhouette.mask[to_row, to_column] == INSIDE).all()
    inside = silhouette.mask == INSIDE
    assert not silhouette.inward[inside].any() and silhouette.inward[~inside].any(axis=-1).all()


def test_the_edges_of_the_picture_are_distinguished_from_those_of_the_window() -> None:
    whole = drawn({"box": BOX})
    wide = drawn({"box": (((0.0, -3.0, 0.0), (0.1, 3.0, 0.1)),)})
    assert not whole.edges.any()
    assert wide.edges.tolist() == [True, False, True, False]
