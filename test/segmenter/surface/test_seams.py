# SPDX-License-Identifier: Apache-2.0
"""Valleys and steps."""

from __future__ import annotations

import numpy as np

from objreg_ros.segmenter.surface.cells import reduce
from objreg_ros.segmenter.surface.seams import find_seams
from segmenter.scenes import Scene

JUMP = (0.012, 0.008)


def seams_of(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    surface = reduce(scene.image().depth, scene.camera, 2, (0.2, 4.0, 100.0), JUMP)
    return find_seams(surface, 20.0, JUMP), scene.owner[::2, ::2]


def test_a_plane_has_no_seam_however_it_slants() -> None:
    assert not seams_of(Scene(tilt_deg=20).plane())[0].any()


def test_the_foot_of_a_box_is_a_seam_and_its_upper_edge_is_none() -> None:
    seams, owner = seams_of(Scene().plane().box((-0.2, 0, 0), (0.2, 0.2, 0.2)))
    column = np.flatnonzero(owner[:, 160] == 2)
    assert seams[column.max() - 1 : column.max() + 3, 160].any()
    assert not seams[column.min() + 6 : column.max() - 8, 160].any()


def test_a_small_step_between_two_boxes_is_a_seam() -> None:
    scene = Scene().plane().box((-0.2, 0.0, 0), (0.0, 0.1, 0.2)).box((0.0, -0.03, 0), (0.2, 0.07, 0.2))
    seams, owner = seams_of(scene)
    row = int(np.flatnonzero((owner == 2).any(axis=1) & (owner == 3).any(axis=1)).mean())
    border = int(np.flatnonzero(np.diff(owner[row]) == 1)[-1])
    assert {owner[row, border], owner[row, border + 1]} == {2, 3}
    assert seams[row, border - 1 : border + 3].any()
