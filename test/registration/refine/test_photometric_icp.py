# SPDX-License-Identifier: Apache-2.0
"""Tests of the refinement on shape and grey at once."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import inverse, pose, pose_error, rotation_from_vector, transform
from objreg_ros.native import kernels
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.kernels.projection import between, project
from objreg_ros.registration.prepare.prepared import Prepared, prepare
from objreg_ros.registration.prepare.views import SHADELESS
from objreg_ros.registration.refine.photometric_icp import finish
from registration.rooms import keyframe, seen_from

PARAMS = RegistrarParams()
WALL = (("room", (-9.0, -9.0, -9.0), (2.0, 9.0, 9.0)),)
FRONT = seen_from(0.0, height=0.75)


def wall(T_world_camera: np.ndarray, seed: int) -> Prepared:
    return prepare(keyframe(T_world_camera, WALL, noise=0.0005, seed=seed), PARAMS)


@pytest.mark.parametrize("shift", [(0.05, 0.0, 0.0), (0.0, -0.05, 0.0), (0.03, 0.03, 0.0)])
def test_a_shift_along_a_bare_wall_is_found_by_its_pattern(shift: tuple[float, float, float]) -> None:
    truth = pose(np.eye(3), np.array(shift))
    T, grey = finish(wall(FRONT @ truth, 1), wall(FRONT, 2), np.eye(4))
    rotation, distance = pose_error(T, truth)
    assert rotation < 0.3 and distance < 0.7
    assert np.linalg.eigvalsh(grey)[0] > 0


def test_a_turn_about_the_line_of_sight_is_found_both_ways() -> None:
    truth = pose(rotation_from_vector(np.array([0.0, 0.0, 0.03])), np.zeros(3))
    a, b = wall(FRONT @ truth, 1), wall(FRONT, 2)
    assert pose_error(finish(a, b, np.eye(4))[0], truth)[0] < 0.3
    assert pose_error(finish(b, a, np.eye(4))[0], inverse(truth))[0] < 0.3


@pytest.mark.parametrize("backwards", [False, True])
def test_a_step_goes_down_the_slope_of_the_weighed_error_of_grey_on_surfaces(backwards: bool) -> None:
    draw, camera, sigma = np.random.default_rng(0), (80.0, 90.0, 40.0, 30.0), 0.7
    T = pose(rotation_from_vector(np.array([0.2, -0.15, 0.3])), np.array([0.1, -0.05, 0.2]))
    detail = draw.normal(size=(60, 80)).astype(np.float32)
    fine = detail.astype(float)
    near = np.full(detail.shape, 2.0, np.float32)
    far = np.where(np.arange(80) < 60, near, np.float32(9.0))  # on the right a depth jump
    u, v, z = draw.uniform(5.0, 70.0, 300), draw.uniform(5.0, 50.0, 300), draw.uniform(1.5, 2.5, 300)
    landed = np.stack([(u - 40.0) / 80.0 * z, (v - 30.0) / 90.0 * z, z], axis=1)
    points = transform(T if backwards else inverse(T), landed).astype(np.float32)
    shades = draw.normal(size=300).astype(np.float32)
    shades[:50] = SHADELESS
    counts = (shades < SHADELESS) & (u < 59.4)

    def cost(step: np.ndarray) -> float:
        moved = pose(rotation_from_vector(step[3:]), step[:3]) @ T
        us, vs, _ = project(points, inverse(moved) if backwards else moved, camera)
        errors = [(between(fine, us[k], vs[k])[0] - float(shades[k])) / sigma for k in np.flatnonzero(counts)]
        return sum(0.5 * e * e / (1.0 + e * e) for e in errors)

    H, g = np.zeros((6, 6)), np.zeros(6)
    own = np.ascontiguousarray(inverse(T) if backwards else T)
    add_grey = kernels("photometric_icp").add_grey
    add_grey((points, shades), own, (near, far, detail, camera), T, backwards, sigma, (1.0, 0.0), H, g)
    slope = [(cost(1e-6 * axis) - cost(-1e-6 * axis)) / 2e-6 for axis in np.eye(6)]
    assert np.allclose(g, slope, rtol=1e-3, atol=1e-3 * np.abs(g).max())
