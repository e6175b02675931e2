# SPDX-License-Identifier: Apache-2.0
"""Hydra reads the pose the other way round, and between bodies."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from objreg_mapper.constraint import inverted
from objreg_mapper.formats.pose_graph_tools import fill_edge
from objreg_ros.data.closures import LoopClosure
from objreg_ros.geometry import inverse, pose, rotation_from_vector

from .blank import CONSTRAINT, QUARTER_LEFT, blank, closure, numbers

HALF = np.sqrt(0.5)
# A camera that looks ahead (z forward, x right) from 0.2 m in front of the body's middle and 0.5 m above it.
AHEAD = pose(np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]), np.array([0.2, 0.0, 0.5]))


def test_keys_are_nanoseconds_and_the_pose_maps_from_into_to() -> None:
    edge = fill_edge(SimpleNamespace(pose=blank()), closure(), np.eye(4), robot=2)
    assert (edge.key_from, edge.key_to) == (1_500_000_000, 63_250_000_000)
    assert (edge.robot_from, edge.robot_to, edge.type) == (2, 2, 1)
    assert numbers(edge.pose) == pytest.approx([*inverse(QUARTER_LEFT)[:3, 3], 0, 0, -HALF, HALF])
    assert numbers(edge.pose)[:3] == pytest.approx([-2, 1, -3])


def test_the_covariance_is_that_of_the_inverse_in_ros_order() -> None:
    edge = fill_edge(SimpleNamespace(pose=blank()), closure(), np.eye(4))
    covariance = np.array(edge.covariance).reshape(6, 6)
    np.testing.assert_allclose(covariance, inverted(CONSTRAINT).covariance)
    np.testing.assert_allclose(np.diag(covariance)[3:], [25, 16, 36])


def seen_from_the_camera(T_body1_body2: np.ndarray) -> LoopClosure:
    """What a camera at AHEAD says of a motion of its body, a centimetre and half a degree certain about its x only."""
    T_from_to = inverse(AHEAD) @ T_body1_body2 @ AHEAD
    covariance = np.diag([1e-4, 1e-12, 1e-12, 1e-6, 1e-12, 1e-12])
    return LoopClosure(from_ns=1, to_ns=2, T_from_to=T_from_to, covariance=covariance, labels=("cup",))


def test_a_camera_that_looks_ahead_gives_the_motion_of_its_body() -> None:
    """The body goes 1 m ahead and turns left: from where it ends, it was 1 m to the left, turned to the right."""
    turned_left = pose(rotation_from_vector(np.array([0.0, 0.0, np.pi / 2])), np.array([1.0, 0.0, 0.0]))
    edge = fill_edge(SimpleNamespace(pose=blank()), seen_from_the_camera(turned_left), AHEAD)
    assert numbers(edge.pose) == pytest.approx([0, 1, 0, 0, 0, -HALF, HALF], abs=1e-9)


def test_the_covariance_is_turned_into_the_axes_of_the_body_and_takes_its_lever_along() -> None:
    """The camera's x is the body's minus y: there lies the centimetre; the turn about it moves the middle."""
    edge = fill_edge(SimpleNamespace(pose=blank()), seen_from_the_camera(np.eye(4)), AHEAD)
    covariance = np.array(edge.covariance).reshape(6, 6)
    sway_x, sway_z = 0.5**2 * 1e-6, 0.2**2 * 1e-6  # the middle is 0.5 m below the camera and 0.2 m behind it
    np.testing.assert_allclose(np.diag(covariance), [sway_x, 1e-4, sway_z, 0, 1e-6, 0], atol=1e-11)
