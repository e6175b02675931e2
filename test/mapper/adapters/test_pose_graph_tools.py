# SPDX-License-Identifier: Apache-2.0
"""Hydra reads the pose the other way round."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from objreg_ros.geometry import inverse
from objreg_ros.mapper.adapters.pose_graph_tools import fill_edge
from objreg_ros.mapper.constraint import inverted

from .blank import CONSTRAINT, QUARTER_LEFT, blank, closure, numbers

HALF = np.sqrt(0.5)


def test_keys_are_nanoseconds_and_the_pose_maps_from_into_to() -> None:
    edge = fill_edge(SimpleNamespace(pose=blank()), closure(), robot=2)
    assert (edge.key_from, edge.key_to) == (1_500_000_000, 63_250_000_000)
    assert (edge.robot_from, edge.robot_to, edge.type) == (2, 2, 1)
    assert numbers(edge.pose) == pytest.approx([*inverse(QUARTER_LEFT)[:3, 3], 0, 0, -HALF, HALF])
    assert numbers(edge.pose)[:3] == pytest.approx([-2, 1, -3])


def test_the_covariance_is_that_of_the_inverse_in_ros_order() -> None:
    edge = fill_edge(SimpleNamespace(pose=blank()), closure())
    covariance = np.array(edge.covariance).reshape(6, 6)
    np.testing.assert_allclose(covariance, inverted(CONSTRAINT).covariance)
    np.testing.assert_allclose(np.diag(covariance)[3:], [25, 16, 36])
