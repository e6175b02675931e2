# SPDX-License-Identifier: Apache-2.0
"""Tests of the optimisers that stand beside the mapper."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_mapper.pose_graph import PoseGraph
from objreg_tools.simulation.walk import Walk, WalkParams, walk


@pytest.fixture(autouse=True)
def _gtsam() -> None:
    pytest.importorskip("gtsam", reason="the map is solved with gtsam")


@pytest.fixture
def walk_with_lies() -> Walk:
    return walk(WalkParams(poses=120, closures=25, corridor_m=2.0, false_share=0.1, lie_m=(1.0, 3.0)), 3)


@pytest.mark.parametrize("name", ["GTSAM LM", "GTSAM GNC", "Open3D"])
def test_without_lies_they_agree_with_the_mapper(walk_with_lies: Walk, name: str) -> None:
    if name == "Open3D":
        pytest.importorskip("open3d", reason="one of the peers is Open3D")
    from map_lies import error_of, filled, solved
    from map_peers import PEERS, Dense

    graph, is_false, _ = filled(walk_with_lies, right_only=True)
    assert len(is_false) and not is_false.any()
    ours = error_of(walk_with_lies, graph, solved(graph).poses)
    theirs = error_of(walk_with_lies, graph, PEERS[name](Dense.of(graph), 4.0).poses)
    assert theirs == pytest.approx(ours, rel=0.2)


def test_those_that_doubt_leave_out_false_closures_and_the_first_node_stays(walk_with_lies: Walk) -> None:
    from map_lies import filled
    from map_peers import PEERS, Dense

    graph, is_false, _ = filled(walk_with_lies, right_only=False)
    answer = PEERS["GTSAM GNC"](Dense.of(graph), 4.0)
    assert is_false.any() and answer.kept.tolist() == (~is_false).tolist()
    assert np.allclose(answer.poses[0], graph.keyframes.poses[0], atol=1e-3)


def test_the_graph_has_a_step_for_each_keyframe_and_all_closures(walk_with_lies: Walk) -> None:
    from map_lies import filled
    from map_peers import Dense

    graph: PoseGraph = filled(walk_with_lies, right_only=False)[0]
    dense = Dense.of(graph)
    assert len(dense.poses) == len(dense.steps) + 1 == len(graph.keyframes)
    assert len(dense.closures) == len(graph.ties) - len(dense.steps)


def test_closures_are_known_less_well_where_pictures_are_off(walk_with_lies: Walk) -> None:
    from map_lies import filled
    from map_peers import Dense

    graph: PoseGraph = filled(walk_with_lies, right_only=False)[0]
    exact, off = Dense.of(graph), Dense.of(graph, graph.params.picture_sigmas)
    assert (np.linalg.det(off.closures.whitening) < np.linalg.det(exact.closures.whitening)).all()
    np.testing.assert_array_equal(off.steps.whitening, exact.steps.whitening)


def test_a_peer_that_there_is_not_is_refused() -> None:
    from map_peers import chosen

    with pytest.raises(ValueError, match="expected peers of Open3D, GTSAM LM, GTSAM GNC, got nonsense"):
        chosen("Open3D, nonsense")
