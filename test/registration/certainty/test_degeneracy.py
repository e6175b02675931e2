# SPDX-License-Identifier: Apache-2.0
"""Tests of what the surfaces hold badly."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import inverse, pose
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.certainty.degeneracy import about_camera, systematic_depth_error
from objreg_ros.registration.prepare.prepared import prepare
from objreg_ros.registration.propose.refinement import refine
from registration.rooms import keyframe, seen_from

PARAMS = RegistrarParams()
TRUTH = inverse(seen_from(20.0)) @ seen_from(0.0)
WALL = (("room", (-9.0, -9.0, -9.0), (2.0, 9.0, 9.0)),)


@pytest.fixture(scope="module")
def pair():
    return tuple(prepare(keyframe(seen_from(a), seed=k), PARAMS) for k, a in enumerate((0.0, 20.0)))


def test_a_furnished_room_leaves_no_degenerate_direction(pair) -> None:
    found = refine(*pair, TRUTH)
    assert np.allclose(found.information, found.information.T)
    assert np.linalg.eigvalsh(found.information).min() > 0
    assert len(found.degenerate) == 0


def test_a_bare_wall_slides_both_ways_and_turns() -> None:
    T = seen_from(0.0, height=0.75)
    wall = prepare(keyframe(T, WALL, noise=0.0003, grey=False), PARAMS)
    found = refine(wall, wall, np.eye(4))
    assert found.degenerate.shape == (3, 6)
    assert np.allclose(np.linalg.norm(found.degenerate, axis=1), 1.0)
    span = np.linalg.qr(found.degenerate.T)[0]
    along, across = T[:3, :3].T @ np.array([0.0, 1.0, 0.0]), T[:3, :3].T @ np.array([1.0, 0.0, 0.0])
    assert np.linalg.norm(span.T @ np.r_[along, 0.0, 0.0, 0.0]) > 0.95
    assert np.linalg.norm(span.T @ np.r_[across, 0.0, 0.0, 0.0]) < 0.3


def test_information_moves_from_the_target_camera_to_the_source_camera() -> None:
    T = pose(np.eye(3), np.array([2.0, 0.0, 0.0]))
    H = np.diag([1.0, 1.0, 1.0, 100.0, 100.0, 100.0])
    C = np.linalg.inv(about_camera(H, T))
    assert C[1, 1] == pytest.approx(1.0 + 4.0 / 100.0)  # a turn of the target camera moves what is 2 m away
    assert C[0, 0] == pytest.approx(1.0)


def test_what_a_warped_depth_turns_moves_the_source_camera_along(pair, monkeypatch) -> None:
    T, turns = pose(np.eye(3), np.array([2.0, 0.0, 1.0])), np.diag([0.1, 0.2, 0.3, 0.0, 0.0, 0.01])
    monkeypatch.setattr("objreg_ros.registration.certainty.degeneracy.systematic_depth_error_of_step", lambda *_: turns)
    C = systematic_depth_error(*pair, T)
    assert (C[0, 0], C[1, 1], C[5, 5]) == pytest.approx((0.1, 0.2 + 2.0**2 * 0.01, 0.01))
    assert C[1, 5] == pytest.approx(2.0 * 0.01)  # a turn about z moves what lies along x along y
    known = turns + 1e-3 * np.eye(6)
    monkeypatch.setattr("objreg_ros.registration.certainty.degeneracy.systematic_depth_error_of_step", lambda *_: known)
    np.testing.assert_allclose(
        systematic_depth_error(*pair, T), np.linalg.inv(about_camera(np.linalg.inv(known), T)), atol=1e-9
    )
