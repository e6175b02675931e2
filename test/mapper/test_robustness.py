# SPDX-License-Identifier: Apache-2.0
"""A lie does not bend the map, whatever solves it: through `PoseGraph` alone.

How many walks of random graphs are made is 50, or ``OBJREG_GRAPHS``.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from objreg_mapper.pose_graph import PoseGraph
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import Odometry
from objreg_ros.geometry import pose, rotation_from_vector
from objreg_tools.report.run.trajectory_error import absolute_trajectory_error
from objreg_tools.simulation.walk import Walk, WalkParams, walk

from .bent import bent, closure, distances, odometry, square

TRUE = square(laps=2)
WALK = odometry(bent(TRUE))
HALF = len(TRUE) // 2
STARTS = np.linspace(2, HALF - 3, 30).astype(int).tolist()
RIGHT = [closure(TRUE, k, k + HALF) for k in STARTS]
NEAR_M = 0.01  # the error with a lie is that without, to this


GRAPHS = int(os.environ.get("OBJREG_GRAPHS", "50"))
FALSE = 0.3  # of all closures


def corrected(odometry: Sequence[Odometry], closures: Iterable[LoopClosure]) -> list[Array]:
    """The poses of the map at the moments of odometry; closures that the graph refuses are left out."""
    graph = PoseGraph()
    for sample in odometry:
        graph.add_odometry(sample)
    for known in closures:
        try:
            graph.add_closure(known)
        except ValueError as error:
            assert "expected" in str(error)
    graph.optimise()
    return graph.corrected(sample.stamp_ns for sample in odometry)


def error_m(closures: list[LoopClosure]) -> float:
    """How far the map of the square is from the truth, m."""
    return float(np.sqrt(np.mean(distances(corrected(WALK, closures), TRUE) ** 2)))


def sure(known: LoopClosure, sigma: float) -> LoopClosure:
    return replace(known, covariance=sigma**2 * np.eye(6))


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
    claimed = [sure(known, 1e-6) for known in [*RIGHT, *false]]
    assert error_m(claimed) == pytest.approx(error_m(RIGHT), abs=NEAR_M)


@pytest.mark.parametrize("variance", [1.1e-30, 1e-20, 1e12, 1e300])
def test_no_covariance_makes_solutions_fail(variance: float) -> None:
    odd = replace(closure(TRUE, 40, 120), covariance=variance * np.eye(6))
    assert error_m([*RIGHT, odd]) == pytest.approx(error_m(RIGHT), abs=NEAR_M)


def random_walk(seed: int) -> Walk:
    """A walk with lies from 0.1 m on, as sure as they like, of which up to a third agree with each other."""
    rng = np.random.default_rng([seed, 4])
    agreeing, farthest_m = float(rng.choice([0.0, 0.05, 0.1])), float(rng.choice([1.0, 10.0, 1e9]))
    params = WalkParams(
        poses=int(rng.integers(80, 200)),
        closures=int(rng.integers(10, 32)),
        corridor_m=float(rng.uniform(2.0, 6.0)),
        false_share=FALSE - agreeing,
        agreeing_share=agreeing,
        lie_m=(0.1, farthest_m),
    )
    return walk(params, seed)


def harm(seed: int) -> float:
    """How many times as far the map is from the truth with the lies as without them."""
    of = random_walk(seed)
    found = [corrected(of.odometry, closures) for closures in (of.right_closures, of.closures)]
    clean, lied_to = (absolute_trajectory_error(poses, list(of.T_world_body)) for poses in found)
    return lied_to / clean


@pytest.mark.slow
def test_a_third_of_lies_hardly_ever_harms_a_map() -> None:
    """Of 300 graphs 17 were harmed by 1.3 times and one by twice: by lies too small for odometry to show."""
    harms = np.array([harm(seed) for seed in range(GRAPHS)])
    harmed = f"harmed: {np.flatnonzero(harms > 1.3).tolist()}"
    assert np.median(harms) <= 1.02, harmed
    assert np.mean(harms > 1.3) <= 0.12, harmed
    assert np.mean(harms > 2.0) <= 0.03, harmed
