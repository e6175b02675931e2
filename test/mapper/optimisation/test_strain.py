# SPDX-License-Identifier: Apache-2.0
"""Closures that agree with each other and contradict odometry: what the mapper says of them, and who is trusted."""

from __future__ import annotations

import numpy as np
import pytest

from mapper.bent import bent, closure, distances, odometry, square
from objreg_mapper.optimisation.strain import LIMIT, Strain
from objreg_mapper.params import MapperParams
from objreg_mapper.pose_graph import MapSummary, PoseGraph
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.geometry import pose

TRUE = square(laps=2)
LAP = len(TRUE) // 2
GOOD = MapperParams(
    odometry_translation_error=0.02, odometry_rotation_error=0.1, steady_heading=0.0, steady_distance=0.0
)
BETTER = GOOD.replaced(odometry_translation_error=0.008, odometry_rotation_error=0.3)


def beside(metres: float) -> Array:
    """What a lie is off by: the second lap is that far beside the first."""
    return pose(np.eye(3), np.array([0.0, metres, 0.0]))


def lies(count: int, metres: float) -> list[LoopClosure]:
    """They agree: each puts the second lap to one and the same place beside the first."""
    first = np.linspace(2, LAP - 3, count).astype(int).tolist()
    moved = [TRUE[k + LAP][:3, :3].T @ (metres * np.array([0.0, 1.0, 0.0])) for k in first]
    return [closure(TRUE, k, k + LAP, pose(np.eye(3), shift)) for k, shift in zip(first, moved, strict=True)]


def mapped(poses: list[Array], closures: list[LoopClosure], params: MapperParams) -> tuple[PoseGraph, MapSummary]:
    graph = PoseGraph(params)
    for one in odometry(poses):
        graph.add_odometry(one)
    for one in closures:
        assert graph.add_closure(one)
    return graph, graph.optimise()


def error(graph: PoseGraph) -> float:
    """How far the worst keyframe is from the truth, m."""
    path = graph.path()
    true = [TRUE[round(stamp / 1e8)] for stamp, _ in path]
    return float(distances([T for _, T in path], true).max())


def test_right_closures_of_odometry_that_is_as_it_says_are_not_suspicious() -> None:
    right = [closure(TRUE, k, k + LAP) for k in range(3, LAP, 13)]
    graph, summary = mapped(bent(TRUE), right, MapperParams())
    assert len(summary.kept) == len(right) == summary.strain.judged
    assert not summary.strain.is_suspicious and summary.strain.beyond == 0
    assert error(graph) < 0.1


def test_lies_that_agree_with_nothing_true_beside_them_are_named_with_their_size() -> None:
    _, summary = mapped(TRUE, lies(12, 0.3), GOOD)
    strain = summary.strain
    assert len(summary.kept) == 12 and strain.is_suspicious and strain.beyond == 12
    assert abs(strain.metres - 0.3) < 0.02 and strain.sigmas > LIMIT


def test_lies_that_agree_are_held_back_where_odometry_is_trusted() -> None:
    believed, _ = mapped(TRUE, lies(12, 0.3), GOOD)
    graph, summary = mapped(TRUE, lies(12, 0.3), GOOD.replaced(trust="odometry"))
    assert error(believed) > 0.2 > 0.01 > error(graph)
    assert not summary.kept and len(summary.pruned) == 12 and not summary.strain.is_suspicious


def test_many_small_lies_push_no_right_closure_out_where_odometry_is_trusted() -> None:
    right = [closure(TRUE, k, k + LAP) for k in (10, 30, 50, 70)]
    graph, summary = mapped(TRUE, [*lies(40, 0.15), *right], BETTER)
    assert summary.strain.is_suspicious and not set(right) & set(summary.kept)
    graph, summary = mapped(TRUE, [*lies(40, 0.15), *right], BETTER.replaced(trust="odometry"))
    assert set(summary.kept) == set(right) and error(graph) < 0.02


def test_closures_are_believed_against_odometry_that_slipped_where_they_are_trusted() -> None:
    slipped = [T if k < LAP else beside(0.6) @ T for k, T in enumerate(TRUE)]
    right = [closure(TRUE, k, k + LAP) for k in (10, 40, 70)]
    weighed, _ = mapped(slipped, right, BETTER)
    graph, summary = mapped(slipped, right, BETTER.replaced(trust="closures"))
    assert len(summary.kept) == len(right)
    assert between_laps(graph) < 0.1 < 0.5 < between_laps(weighed)


def between_laps(graph: PoseGraph) -> float:
    """How far the second lap is from the first half way, m."""
    at = [T for stamp, T in graph.path() if round(stamp / 1e8) in (40, 40 + LAP)]
    return float(np.linalg.norm(at[0][:3, 3] - at[1][:3, 3]))


@pytest.mark.parametrize(
    ("judged", "beyond", "is_suspicious"), [(1, 1, False), (2, 2, True), (100, 5, False), (100, 6, True)]
)
def test_what_chance_puts_beyond_the_limit_is_not_suspicious(judged: int, beyond: int, is_suspicious: bool) -> None:
    assert Strain(judged, beyond).is_suspicious is is_suspicious


def test_without_closures_nothing_is_strained() -> None:
    _, summary = mapped(TRUE, [], GOOD)
    assert summary.strain == Strain()
