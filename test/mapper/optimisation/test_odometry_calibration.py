# SPDX-License-Identifier: Apache-2.0
"""What is taken out of odometry, and when."""

from __future__ import annotations

import numpy as np
import pytest

from mapper.bent import bent, odometry, square
from objreg_mapper.constraint import Constraint
from objreg_mapper.optimisation.chain import Chain
from objreg_mapper.optimisation.edges import edges_of
from objreg_mapper.optimisation.odometry_calibration import Fit, OdometryCalibration
from objreg_mapper.optimisation.problem import Problem
from objreg_mapper.optimisation.robust import RobustGraph
from objreg_mapper.optimisation.route import Route
from objreg_mapper.optimisation.solver import Solver
from objreg_mapper.optimisation.steady import Steady
from objreg_mapper.params import MapperParams
from objreg_mapper.session import Session
from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse

TRUE = square(laps=2)
CLOSURES = [(k, k + 12) for k in range(0, 40, 4)]


def session(poses: list[Array]) -> Session:
    made = Session()
    for one in odometry(poses):
        made.add_pose(one, MapperParams())
    return made


def fitted(known: Session, params: MapperParams) -> tuple[Fit, Fit]:
    """Odometry as it is with what is true of some keyframes, and the fit that explains most."""
    count = len(known.keyframes)
    route = Route(Chain.of(known, count, Steady()), tuple(range(count)), tuple(range(count)))
    graph = RobustGraph(known.keyframes.poses[0], params.max_residual**2)
    graph.grow(np.array(known.keyframes.poses[1:]), edges_of(route.steps()))
    true = [TRUE[stamp // 100_000_000] for stamp in known.keyframes.stamps_ns]
    for k1, k2 in CLOSURES:
        graph.close(edges_of([(k1, k2, Constraint(inverse(true[k1]) @ true[k2], 1e-4 * np.eye(6)))]))
    problem = Problem(Solver(), [known], (count,), [], 0, frozenset(), params)
    plain = Fit({0: route}, graph)
    return plain, OdometryCalibration(problem, []).best(plain)


def test_a_heading_that_turns_with_the_path_is_taken_out() -> None:
    plain, best = fitted(session(bent(TRUE)), MapperParams())
    expected = MapperParams().steady
    assert best.is_corrected and best.routes[0].chain.steady.heading < -0.01
    assert best.cost(expected) < plain.cost(expected) and not plain.is_corrected


def test_right_odometry_is_left_as_it_is() -> None:
    plain, best = fitted(session(TRUE), MapperParams())
    assert best is plain


def test_nothing_is_taken_out_where_nothing_is_expected() -> None:
    plain, best = fitted(session(bent(TRUE)), MapperParams(steady_heading=0.0, steady_distance=0.0))
    assert best is plain


def test_what_is_unexpected_costs() -> None:
    plain, best = fitted(session(bent(TRUE)), MapperParams())
    chain = best.routes[0].chain
    assert best.cost(Steady(0.1, 0.1, 0.1)) < best.cost(Steady(1e-3, 1e-3, 1e-3))
    assert best.cost(Steady(abs(chain.steady.heading), 0.0, 0.0)) == pytest.approx(best.graph.cost + 1.0)
    assert plain.cost(Steady(1e-3, 1e-3, 1e-3)) == plain.graph.cost
