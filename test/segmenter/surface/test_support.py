# SPDX-License-Identifier: Apache-2.0
"""Level planes of a frame."""

from __future__ import annotations

import numpy as np

from objreg_ros.segmenter.surface.cells import reduce
from objreg_ros.segmenter.surface.support import find_supports
from segmenter.scenes import Scene

JUMP = (0.012, 0.008)


def supports_of(scene: Scene) -> list:
    surface = reduce(scene.image(0.0015).depth, scene.camera, 2, (0.2, 4.0, 100.0), JUMP)
    return find_supports(surface.every(2), scene.camera, scene.up, 0.02, JUMP)


def test_table_and_shelf_are_both_found_at_their_heights() -> None:
    scene = Scene().plane().box((-0.3, 0.2, 0.0), (0.3, 0.5, 0.25))
    heights = sorted(scene.eye[2] - s.plane.offset for s in supports_of(scene))
    np.testing.assert_allclose(heights, (0.0, 0.25), atol=0.003)


def test_the_plane_of_a_table_is_right_to_a_tenth_of_a_degree() -> None:
    scene = Scene().plane().box((-0.1, -0.1, 0.0), (0.1, 0.1, 0.15))
    plane = supports_of(scene)[0].plane
    assert np.degrees(np.arccos(min(1.0, plane.normal @ scene.up))) < 0.15
    assert abs(scene.eye[2] - plane.offset) < 0.002


def test_a_wall_is_no_support() -> None:
    assert supports_of(Scene(tilt_deg=10).box((-9, 1.0, -9), (9, 1.1, 9))) == []
