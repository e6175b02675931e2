# SPDX-License-Identifier: Apache-2.0
"""Which nodes a constraint ties, and by what way it gets there. No ROS."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from objreg_mapper.adapters.rtabmap_nodes import RtabmapNodes
from objreg_mapper.sparse import SparseTrajectory
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.geometry import inverse, pose, quaternion_from_rotation, rotation_from_vector

SECOND = 1_000_000_000
MEASURED = pose(rotation_from_vector(np.array([0.1, -0.2, 0.3])), np.array([0.4, -0.1, 0.25]))


def body_at(seconds: float) -> Array:
    return pose(rotation_from_vector(np.array([0.0, 0.0, 0.05 * seconds])), np.array([0.1 * seconds, 0.0, 0.0]))


def node(number: int, stamp: float, T: Array | None = None, map_id: int = 0, weight: int = 0) -> Any:
    where, turn = SimpleNamespace(x=0.0, y=0.0, z=0.0), SimpleNamespace(x=0.0, y=0.0, z=0.0, w=0.0)
    if T is not None:
        where.x, where.y, where.z = T[:3, 3]
        turn.x, turn.y, turn.z, turn.w = quaternion_from_rotation(T[:3, :3])
    placed = SimpleNamespace(position=where, orientation=turn)
    return SimpleNamespace(id=number, stamp=stamp, map_id=map_id, weight=weight, pose=placed)


def nodes_of(*nodes: Any) -> RtabmapNodes:
    made = RtabmapNodes()
    made.add_map_data(SimpleNamespace(nodes=nodes))
    return made


def walk(*stamps: int) -> RtabmapNodes:
    return nodes_of(*(node(k + 1, float(stamp), body_at(stamp)) for k, stamp in enumerate(stamps)))


def closure(from_s: float, to_s: float) -> LoopClosure:
    moments = {"from_ns": round(from_s * SECOND), "to_ns": round(to_s * SECOND)}
    return LoopClosure(T_from_to=MEASURED, covariance=1e-4 * np.eye(6), labels=(), **moments)


def expected(k1: float, from_s: float, to_s: float, k2: float) -> Array:
    return inverse(body_at(k1)) @ body_at(from_s) @ MEASURED @ inverse(body_at(to_s)) @ body_at(k2)


def test_a_moment_of_a_node_ties_that_node_with_what_was_measured() -> None:
    k1, k2, constraint = walk(1, 2, 61, 62).tied(closure(2.0, 61.0), SparseTrajectory(), np.eye(4))  # type: ignore[misc]
    assert (k1, k2) == (2, 3)
    np.testing.assert_allclose(constraint.T_from_to, MEASURED, atol=1e-9)


def test_between_nodes_the_nodes_own_odometry_leads_there_and_costs_certainty() -> None:
    k1, k2, constraint = walk(1, 2, 61, 62).tied(closure(1.3, 61.6), SparseTrajectory(), np.eye(4))  # type: ignore[misc]
    assert (k1, k2) == (1, 4)
    np.testing.assert_allclose(constraint.T_from_to, expected(1, 1.3, 61.6, 62), atol=1e-9)
    assert np.linalg.eigvalsh(constraint.covariance).min() > 1e-4


def test_odometry_that_covers_the_ways_counts_more_than_what_nodes_say() -> None:
    nodes = nodes_of(node(1, 1.0, np.eye(4)), node(2, 61.0, np.eye(4)))  # as if the body had not moved
    odometry = SparseTrajectory()
    for tenth in range(800):
        odometry.append(tenth * SECOND // 10, body_at(tenth / 10))
    k1, k2, constraint = nodes.tied(closure(1.3, 60.8), odometry, np.eye(4))  # type: ignore[misc]
    assert (k1, k2) == (1, 2)
    np.testing.assert_allclose(constraint.T_from_to, expected(1, 1.3, 60.8, 61), atol=1e-9)


def test_odometry_that_was_silent_on_the_way_leads_nowhere() -> None:
    odometry = SparseTrajectory()
    for tenth in (*range(10), *range(25, 800)):  # it may have begun anew between 0.9 and 2.5 s
        odometry.append(tenth * SECOND // 10, body_at(tenth / 10))
    nodes = nodes_of(node(1, 0.8, body_at(0.8)), node(2, 61.0, body_at(61), map_id=1))
    assert nodes.tied(closure(0.7, 60.8), odometry, np.eye(4)) is not None
    assert nodes.tied(closure(2.6, 60.8), odometry, np.eye(4)) is None


@pytest.mark.parametrize("last_map", [0, 1])
def test_no_way_leads_past_the_newest_node_or_from_one_map_to_another(last_map: int) -> None:
    nodes = nodes_of(node(1, 1.0, body_at(1)), node(2, 61.0, body_at(61)), node(3, 62.0, body_at(62), map_id=last_map))
    assert (nodes.tied(closure(1.0, 61.4), SparseTrajectory(), np.eye(4)) is None) == bool(last_map)
    assert nodes.tied(closure(1.0, 62.4), SparseTrajectory(), np.eye(4)) is None


def test_a_number_with_another_stamp_is_of_another_database() -> None:
    nodes = walk(1, 2, 61)
    assert not nodes.add_map_data(SimpleNamespace(nodes=[node(3, 61.0, body_at(61)), node(4, 62.0, body_at(62))]))
    assert nodes.add_map_data(SimpleNamespace(nodes=[node(1, 500.0, body_at(0))])) and len(nodes) == 1


def test_intermediate_nodes_landmarks_and_nodes_without_odometry_are_left_out() -> None:
    assert len(nodes_of(node(1, 1.0, np.eye(4)), node(2, 2.0, np.eye(4), weight=-1), node(3, 3.0), node(-4, 4.0))) == 1


@pytest.mark.parametrize("stamp", [float("nan"), float("inf"), -1.0, 1e12])
def test_a_stamp_that_is_none_is_refused(stamp: float) -> None:
    with pytest.raises(ValueError, match="mapData: expected a stamp"):
        nodes_of(node(1, stamp, np.eye(4)))


@pytest.mark.parametrize("metres", [float("nan"), float("inf"), 1e9])
def test_a_pose_that_is_none_is_refused(metres: float) -> None:
    with pytest.raises(ValueError, match="mapData: expected a pose within"):
        nodes_of(node(1, 1.0, pose(np.eye(3), np.array([0.0, metres, 0.0]))))


def test_without_nodes_there_is_none_that_is_nearest() -> None:
    with pytest.raises(ValueError, match="got none"):
        RtabmapNodes().nearest(0)
