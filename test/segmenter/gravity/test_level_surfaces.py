# SPDX-License-Identifier: Apache-2.0
"""Up from normals."""

from __future__ import annotations

import numpy as np

from objreg_ros.segmenter.gravity.level_surfaces import camera_up, estimate_up, known_normals


def around(direction: np.ndarray, count: int, spread: float = 0.03) -> np.ndarray:
    n = direction / np.linalg.norm(direction) + np.random.default_rng(0).normal(0, spread, (count, 3))
    return (n / np.linalg.norm(n, axis=1, keepdims=True)).astype(np.float32)


def test_the_floor_wins_over_a_larger_wall() -> None:
    floor, wall = np.array([0.0, -0.9, -0.43]), np.array([0.1, 0.0, -1.0])
    up, confidence = estimate_up(np.vstack([around(floor, 600), around(wall, 2500)]), camera_up(0.0), 65.0)
    assert up is not None
    assert up @ floor / np.linalg.norm(floor) > np.cos(np.radians(0.5))
    assert confidence > 0.9


def test_walls_alone_give_nothing() -> None:
    assert estimate_up(around(np.array([0.2, 0.05, -1.0]), 2000), camera_up(0.0), 65.0) == (None, 0.0)


def test_two_candidates_alike_give_little_confidence() -> None:
    tilted = [np.array([0.0, -0.8, s]) for s in (0.6, -0.6)]
    _, confidence = estimate_up(np.vstack([around(t, 800) for t in tilted]), camera_up(0.0), 65.0)
    assert confidence < 0.3


def test_a_guess_that_deserves_little_confidence_is_none() -> None:
    rng = np.random.default_rng(0)
    anywhere = rng.normal(0, 1, (4000, 3))
    anywhere = (anywhere / np.linalg.norm(anywhere, axis=1, keepdims=True)).astype(np.float32)
    assert estimate_up(anywhere, camera_up(0.0), 75.0) == (None, 0.0)


def test_noise_does_not_pull_up_towards_the_camera_s_own() -> None:
    floor = np.array([0.0, -np.cos(np.radians(68)), -np.sin(np.radians(68))])
    up, _ = estimate_up(around(floor, 3000, spread=0.15), camera_up(0.0), 75.0)
    assert up is not None
    assert up @ floor > np.cos(np.radians(3.0))


def test_a_camera_turned_clockwise_has_up_to_its_left() -> None:
    np.testing.assert_allclose(camera_up(0.0), (0, -1, 0), atol=1e-12)
    np.testing.assert_allclose(camera_up(90.0), (-1, 0, 0), atol=1e-12)


def test_unknown_normals_are_left_out() -> None:
    normals = np.zeros((3, 6, 8), np.float32)
    normals[2, ::2, 1:] = -1
    assert known_normals(normals, 1).shape == (21, 3)


def test_a_ring_of_normals_with_none_in_its_middle_gives_its_middle() -> None:
    angle, tilt = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False), np.radians(7.0)
    ring = np.stack([np.sin(tilt) * np.cos(angle), np.full(400, -np.cos(tilt)), np.sin(tilt) * np.sin(angle)], axis=1)
    up, _ = estimate_up(ring.astype(np.float32), camera_up(0.0), 65.0)
    assert up is not None
    assert up @ [0.0, -1.0, 0.0] > np.cos(np.radians(0.5))
