# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from objreg_ros import geometry as g

REACH = st.floats(-10, 10)
VECTORS = arrays(np.float64, 3, elements=REACH)
ANGLES = st.floats(0, np.pi - 1e-6)
HALF = np.sqrt(0.5)
QUARTER_TURN = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])  # about z, x to y


@st.composite
def rotation_vectors(draw: st.DrawFn) -> np.ndarray:
    """An axis of any direction by an angle below half a turn."""
    axis = draw(VECTORS.filter(lambda v: np.linalg.norm(v) > 1e-3))
    return draw(ANGLES) * axis / np.linalg.norm(axis)


@st.composite
def poses(draw: st.DrawFn) -> np.ndarray:
    return g.pose(g.rotation_from_vector(draw(rotation_vectors())), draw(VECTORS))


def test_a_quarter_turn_is_the_same_in_every_form() -> None:
    vector = np.array([0, 0, np.pi / 2])
    assert np.allclose(g.rotation_from_vector(vector), QUARTER_TURN)
    assert np.allclose(g.vector_from_rotation(QUARTER_TURN), vector)
    assert np.allclose(g.quaternion_from_rotation(QUARTER_TURN), [0, 0, HALF, HALF])
    assert np.allclose(g.rotation_from_quaternion(np.array([0, 0, HALF, HALF])), QUARTER_TURN)
    assert g.rotation_angle(QUARTER_TURN) == pytest.approx(np.pi / 2)


def test_a_pose_maps_points_of_b_into_a() -> None:
    T_a_b = g.pose(QUARTER_TURN, np.array([10.0, 0, 0]))
    assert np.allclose(g.transform(T_a_b, np.array([[1.0, 0, 0]])), [[10, 1, 0]])
    assert np.allclose(g.rotate(T_a_b, np.array([[1.0, 0, 0]])), [[0, 1, 0]])


def test_points_keep_their_dtype_and_shape() -> None:
    points = np.ones((4, 5, 3), np.float32)
    moved = g.transform(g.pose(QUARTER_TURN, np.ones(3)), points)
    assert moved.dtype == np.float32 and moved.shape == (4, 5, 3)
    assert g.rotate(np.eye(4), points).dtype == np.float32


@given(poses(), VECTORS)
def test_the_inverse_brings_points_back(T: np.ndarray, point: np.ndarray) -> None:
    assert np.allclose(g.transform(g.inverse(T), g.transform(T, point)), point, atol=1e-9)
    assert np.allclose(T @ g.inverse(T), np.eye(4), atol=1e-9)


@given(rotation_vectors())
def test_a_rotation_vector_goes_there_and_back(vector: np.ndarray) -> None:
    R = g.rotation_from_vector(vector)
    assert np.allclose(R @ R.T, np.eye(3), atol=1e-12) and np.linalg.det(R) > 0
    assert np.allclose(g.rotation_from_vector(g.vector_from_rotation(R)), R, atol=1e-9)
    assert np.allclose(g.vector_from_rotation(R), vector, atol=1e-5)


@given(rotation_vectors())
def test_a_quaternion_goes_there_and_back(vector: np.ndarray) -> None:
    R = g.rotation_from_vector(vector)
    q = g.quaternion_from_rotation(R)
    assert q[3] >= 0 and np.linalg.norm(q) == pytest.approx(1)
    assert np.allclose(g.rotation_from_quaternion(q), R, atol=1e-9)
    assert np.allclose(g.rotation_from_quaternion(-3 * q), R, atol=1e-9)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.6, 0, 0.8), (-0.48, 0.6, 0.64)])
def test_half_a_turn_is_no_special_case(axis: tuple[float, float, float]) -> None:
    vector = np.pi * np.array(axis)
    R = g.rotation_from_vector(vector)
    back = g.vector_from_rotation(R)
    assert np.linalg.norm(back) == pytest.approx(np.pi)
    assert np.allclose(g.rotation_from_vector(back), R, atol=1e-9)


@pytest.mark.parametrize("angle", [0.0, 1e-15, 1e-12, 1e-9, 1e-6])
def test_small_angles_are_exact(angle: float) -> None:
    R = g.rotation_from_vector(np.array([angle, 0, 0]))
    assert g.rotation_angle(R) == pytest.approx(angle, rel=1e-6, abs=1e-16)


@pytest.mark.parametrize("q", [np.zeros(4), np.full(4, np.nan), np.full(4, 1e-10), np.array([np.inf, 0, 0, 1])])
def test_a_quaternion_without_a_direction_is_refused(q: np.ndarray) -> None:
    with pytest.raises(ValueError, match="expected a quaternion of non-zero length"):
        g.rotation_from_quaternion(q)


def test_the_error_of_a_pose_is_in_degrees_and_centimetres() -> None:
    T_true = g.pose(QUARTER_TURN, np.array([1.0, 2, 3]))
    off = g.pose(QUARTER_TURN @ g.rotation_from_vector(np.array([0.1, 0, 0])), np.array([1.0, 2.03, 3.04]))
    assert g.pose_error(off, T_true) == pytest.approx((np.degrees(0.1), 5))
    assert g.pose_error(T_true, T_true) == pytest.approx((0, 0), abs=1e-6)


@given(poses(), poses())
def test_the_error_is_the_same_from_both_sides(T_a: np.ndarray, T_b: np.ndarray) -> None:
    assert g.pose_error(T_a, T_b) == pytest.approx(g.pose_error(T_b, T_a), abs=1e-6)


@given(VECTORS.filter(lambda v: np.linalg.norm(v) > 1e-3), VECTORS.filter(lambda v: np.linalg.norm(v) > 1e-3))
def test_the_rotation_between_two_directions_turns_one_into_the_other(a: np.ndarray, b: np.ndarray) -> None:
    R = g.rotation_between(a, b)
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    assert np.allclose(R @ a, b, atol=1e-4) and np.allclose(R @ R.T, np.eye(3), atol=1e-4)
    assert g.rotation_angle(R) == pytest.approx(np.arccos(np.clip(a @ b, -1, 1)), abs=1e-3)


@pytest.mark.parametrize("direction", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)])
def test_opposite_directions_are_half_a_turn_apart(direction: tuple[float, float, float]) -> None:
    a = np.array(direction, float)
    R = g.rotation_between(a, -a)
    assert np.allclose(R @ a, -a) and np.linalg.det(R) == pytest.approx(1)


@given(poses(), poses())
def test_interpolation_ends_where_it_should(T_a: np.ndarray, T_b: np.ndarray) -> None:
    assert np.allclose(g.interpolate(T_a, T_b, 0.0), T_a, atol=1e-9)
    assert np.allclose(g.interpolate(T_a, T_b, 1.0), T_b, atol=1e-7)


def test_half_way_is_half_the_turn_and_half_the_way() -> None:
    T = g.interpolate(np.eye(4), g.pose(QUARTER_TURN, np.array([2.0, 0, 0])), 0.5)
    assert np.allclose(T, g.pose(g.rotation_from_vector(np.array([0, 0, np.pi / 4])), np.array([1.0, 0, 0])))


def test_what_is_rigid_and_what_is_not() -> None:
    mirrored, sheared, scaled = np.diag([1.0, 1, -1, 1]), np.eye(4), np.diag([2.0, 2, 2, 1])
    sheared[0, 1] = 0.1
    last_row = np.eye(4)
    last_row[3, 0] = 1
    assert g.is_rigid(g.pose(QUARTER_TURN, np.ones(3)))
    for wrong in (mirrored, sheared, scaled, last_row, np.full((4, 4), np.nan), np.eye(3)):
        assert not g.is_rigid(wrong)


def test_a_mounting_is_seven_numbers_or_none_at_all() -> None:
    T = g.mounting((0.1, 0.2, 0.3, 0.0, 0.0, 2.0, 0.0))
    assert T is not None and np.allclose(T[:3], [[-1, 0, 0, 0.1], [0, -1, 0, 0.2], [0, 0, 1, 0.3]])
    assert g.mounting(()) is None
    with pytest.raises(ValueError, match="expected x y z qx qy qz qw or nothing, got"):
        g.mounting((1.0, 2.0))
    with pytest.raises(ValueError, match="non-zero length"):
        g.mounting((0.0,) * 7)


def test_a_pose_after_many_products_is_made_rigid_again() -> None:
    T = g.pose(QUARTER_TURN + 1e-4 * np.arange(9.0).reshape(3, 3), np.ones(3))
    assert not g.is_rigid(T) and g.is_rigid(g.rigid(T), 1e-12)
    np.testing.assert_allclose(g.rigid(T), T, atol=1e-3)


def leaps(T_after: np.ndarray, seconds: float, max_speed: float) -> bool:
    """Whether odometry leaps there from where it first was."""
    return g.leaps(np.eye(4), T_after, seconds, max_speed, T_odom_first=np.eye(4))


def test_what_no_body_does_is_a_leap() -> None:
    half_turn = g.pose(QUARTER_TURN @ QUARTER_TURN, np.zeros(3))
    ahead = g.pose(np.eye(3), np.array([1.0, 0.0, 0.0]))
    assert leaps(ahead, 0.05, 5.0) and not leaps(ahead, 0.2, 5.0) and not leaps(ahead, 0.05, 20.0)
    assert leaps(half_turn, 0.1, 5.0) and not leaps(half_turn, 0.5, 5.0)


def test_coming_back_to_exactly_the_first_pose_after_a_silence_is_a_leap() -> None:
    first, away, near = (g.pose(QUARTER_TURN, np.array([x, 2.0, 0.0])) for x in (1.0, 4.0, 1.3))
    assert g.leaps(away, first, 60.0, 5.0, first) and not g.leaps(away, first, 0.9, 5.0, first)
    assert not g.leaps(away, near, 60.0, 5.0, first)  # it may have driven there
    assert not g.leaps(near, first, 60.0, 5.0, first)  # a robot that stands still where it began


def test_the_rigid_fit_finds_the_motion_and_never_a_mirror() -> None:
    T = g.pose(g.rotation_from_vector(np.array([0.3, -2.0, 1.1])), np.array([4.0, -1.0, 2.0]))
    xyz = np.random.default_rng(3).normal(size=(30, 3)) * [1.0, 1.0, 0.01]
    np.testing.assert_allclose(g.rigid_fit(xyz, g.transform(T, xyz)), T, atol=1e-9)
    assert np.linalg.det(g.rigid_fit(xyz * [1.0, 1.0, -1.0], xyz)[:3, :3]) == pytest.approx(1)
    for few, many in ((0, 0), (3, 4)):
        with pytest.raises(ValueError, match="expected as many points as partners, at least 1"):
            g.rigid_fit(xyz[:few], xyz[:many])


@given(VECTORS, VECTORS)
def test_skew_is_the_cross_product(v: np.ndarray, w: np.ndarray) -> None:
    assert np.allclose(g.skew(v) @ w, np.cross(v, w))


def test_back_projection_knows_its_pixels() -> None:
    depth = np.full((3, 4), 2.0, np.float32)
    points = g.back_project(depth, fx=4.0, fy=5.0, cx=1.0, cy=2.0)
    assert points.shape == (3, 4, 3) and points.dtype == np.float32
    assert np.allclose(points[2, 1], [0, 0, 2]) and np.allclose(points[0, 3], [1, -0.8, 2])


def test_a_point_on_a_lever_moves_as_the_rotation_is_unsure() -> None:
    covariance = np.diag([0.0, 0.0, 0.0, 0.0, 0.0, 0.01])
    at = g.turned_about(covariance, np.array([2.0, 0.0, 5.0]))
    assert np.allclose(np.diag(at), [0.0, 0.04, 0.0, 0.0, 0.0, 0.01])  # about z: x goes along y
    assert at[1, 5] == pytest.approx(0.02) and np.allclose(at, at.T)
