# SPDX-License-Identifier: Apache-2.0
"""A lie does not bend the map, whatever solves it: through `PoseGraph` alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.data import Array, LoopClosure
from objreg_ros.geometry import pose, rotation_from_vector
from objreg_ros.mapper.pose_graph import PoseGraph

from .bent import bent, closure, distances, odometry, square

TRUE = square(laps=2)
WALK = odometry(bent(TRUE))
HALF = len(TRUE) // 2
STARTS = np.linspace(2, HALF - 3, 30).astype(int).tolist()
RIGHT = [closure(TRUE, k, k + HALF) for k in STARTS]
NEAR_M = 0.01  # the error with a lie is that without, to this


def error_m(closures: list[LoopClosure]) -> float:
    """The absolute trajectory error of a map, m; closures that the graph refuses are left out."""
    graph = PoseGraph()
    for word in WALK:
        graph.add_odometry(word)
    for word in closures:
        try:
            graph.add_closure(word)
        except ValueError as error:
            assert "expected" in str(error)
    graph.optimise()
    found = distances(graph.corrected(word.stamp_ns for word in WALK), TRUE)
    return float(np.sqrt(np.mean(found**2)))


def sure(word: LoopClosure, sigma: float) -> LoopClosure:
    return replace(word, covariance=sigma**2 * np.eye(6))


def off(metres: float, degrees: float = 0.0) -> Array:
    return pose(rotation_from_vector(np.radians([0.0, 0.0, degrees])), np.array([metres, 0.0, 0.0]))


@pytest.mark.parametrize("moments", [(40, 120), (5, 152), (80, 100)])
@pytest.mark.parametrize("metres", [10.0, 20.0, 50.0, 1e9, 1e160])
def test_one_false_closure_among_thirty_leaves_the_map(metres: float, moments: tuple[int, int]) -> None:
    false = sure(closure(TRUE, *moments, off(metres)), 1e-2)
    assert error_m([*RIGHT, false]) == pytest.approx(error_m(RIGHT), abs=NEAR_M)


@pytest.mark.parametrize("false_count", [1, 8])  # 3 % and 21 % of all
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_false_closures_that_claim_a_micrometre_leave_the_map(false_count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    false = []
    for _ in range(false_count):
        a = int(rng.integers(0, HALF))
        b = int(rng.integers(a + 20, len(TRUE)))
        false.append(closure(TRUE, a, b, off(rng.uniform(0.3, 3.0), rng.uniform(-60.0, 60.0))))
    claimed = [sure(word, 1e-6) for word in [*RIGHT, *false]]
    assert error_m(claimed) == pytest.approx(error_m(RIGHT), abs=NEAR_M)


@pytest.mark.parametrize("variance", [1.1e-30, 1e-20, 1e12, 1e300])
def test_no_covariance_makes_solutions_fail(variance: float) -> None:
    odd = replace(closure(TRUE, 40, 120), covariance=variance * np.eye(6))
    assert error_m([*RIGHT, odd]) == pytest.approx(error_m(RIGHT), abs=NEAR_M)
