# SPDX-License-Identifier: Apache-2.0
"""A bent square becomes straight, and a wrong edge does not bend it again."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from objreg_mapper.closure_constraint import ImplausibleError
from objreg_mapper.optimisation.chain import Chain
from objreg_mapper.optimisation.edges import Edges
from objreg_mapper.optimisation.incremental import IncrementalGraph
from objreg_mapper.optimisation.problem import Solution, SolvedTrajectory
from objreg_mapper.optimisation.steady import Steady
from objreg_mapper.params import MapperParams
from objreg_mapper.pose_graph import PoseGraph
from objreg_mapper.sparse import TOLERANCE_DEG, TOLERANCE_M
from objreg_mapper.trajectory import Trajectory
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import Odometry
from objreg_ros.geometry import interpolate, inverse, pose, pose_error, rotation_from_vector

from .bent import SECOND, bent, closure, distances, odometry, square

TRUE = square(laps=2)
BENT = bent(TRUE)
HALF = len(TRUE) // 2
RIGHT = [closure(TRUE, k, k + HALF) for k in range(3, HALF, 13)]
SIDEWAYS = pose(rotation_from_vector(np.array([0.0, 0.0, 1.2])), np.array([0.8, 0.6, 0.0]))


def mapped(closures: list[LoopClosure], params: MapperParams | None = None) -> PoseGraph:
    graph = PoseGraph(params)
    for pose_in_time in odometry(BENT):
        graph.add_odometry(pose_in_time)
    for constraint in closures:
        assert graph.add_closure(constraint)
    return graph


def corrected(graph: PoseGraph) -> list[Array]:
    return graph.corrected(o.stamp_ns for o in odometry(BENT))


def test_a_bent_square_becomes_straight() -> None:
    graph = mapped(RIGHT)
    summary = graph.optimise()
    before, after = distances(BENT, TRUE), distances(corrected(graph), TRUE)
    assert len(summary.kept) == len(RIGHT) and not summary.pruned
    assert np.sqrt(np.mean(after**2)) < 0.25 * np.sqrt(np.mean(before**2))


def test_wrong_edges_are_pruned_and_change_nothing() -> None:
    wrong = [closure(TRUE, 10, 90, SIDEWAYS), closure(TRUE, 30, 130, inverse(SIDEWAYS))]
    clean, dirty = mapped(RIGHT), mapped([*RIGHT[:3], *wrong, *RIGHT[3:]])
    clean.optimise()
    summary = dirty.optimise()
    assert {(c.from_ns, c.to_ns) for c in summary.pruned} == {(c.from_ns, c.to_ns) for c in wrong}
    assert distances(corrected(dirty), corrected(clean)).max() < 0.005


def test_a_map_far_from_the_origin_of_odometry_is_the_same_map() -> None:
    T_utm_odom = pose(np.eye(3), np.array([450_000.0, 5_400_000.0, 120.0]))
    near, far = mapped(RIGHT), PoseGraph()
    for known in odometry(BENT):
        far.add_odometry(replace(known, T_odom_body=T_utm_odom @ known.T_odom_body))
    for constraint in RIGHT:
        assert far.add_closure(constraint)
    near.optimise()
    assert not far.optimise().pruned
    there = [inverse(T_utm_odom) @ T for T in corrected(far)]
    assert distances(there, corrected(near)).max() < 1e-4


def test_without_closures_the_map_is_odometry() -> None:
    graph = mapped([])
    assert graph.optimise().kept == ()
    np.testing.assert_allclose(graph.T_map_odom, np.eye(4), atol=1e-12)
    assert distances(corrected(graph), BENT).max() < TOLERANCE_M
    for stamp, T_odom_body in graph.keyframes:
        np.testing.assert_allclose(graph.corrected([stamp])[0], T_odom_body, atol=1e-12)


def test_a_robot_at_rest_adds_nothing_however_often_its_odometry_comes() -> None:
    graph = PoseGraph()
    for k in range(12_000):  # a minute at 200 Hz
        graph.add_odometry(Odometry(T_odom_body=TRUE[0], stamp_ns=k * SECOND // 200))
    assert (len(graph.odometry), len(graph.keyframes)) == (2, 1)
    assert graph.odometry.covers(11_999 * SECOND // 200)
    graph.add_odometry(Odometry(T_odom_body=TRUE[5], stamp_ns=60 * SECOND))
    np.testing.assert_array_equal(graph.odometry.at(11_999 * SECOND // 200), TRUE[0])


class EveryPose(Trajectory):
    """An odometry that leaves nothing out."""

    def pin(self) -> None:
        """Everything stays."""

    def silent_s(self, first_ns: int, last_ns: int) -> float:
        """It never is."""
        return 0.0


def often(poses: list[Array]) -> list[Odometry]:
    """The walk of `odometry` at 200 Hz, trembling by a third of a millimetre."""
    rng = np.random.default_rng(4)
    return [
        Odometry(T_odom_body=T @ pose(np.eye(3), 1e-4 * rng.standard_normal(3)), stamp_ns=(20 * k + i) * SECOND // 200)
        for k, (a, b) in enumerate(pairwise(poses))
        for i, T in ((i, interpolate(a, b, i / 20)) for i in range(20))
    ]


def test_leaving_poses_out_changes_no_answer_by_more_than_millimetres() -> None:
    sparse, whole = PoseGraph(), PoseGraph()
    whole.sessions[0].odometry = EveryPose()  # type: ignore[assignment]
    walk = often(BENT)
    for graph in (sparse, whole):
        for pose_in_time in walk:
            graph.add_odometry(pose_in_time)
        for constraint in RIGHT[:-1]:
            assert graph.add_closure(constraint)
    for ours, theirs in zip(sparse.ties, whole.ties, strict=True):
        degrees, centimetres = pose_error(ours.constraint.T_from_to, theirs.constraint.T_from_to)
        assert degrees < 2 * TOLERANCE_DEG and centimetres < 100 * 3 * TOLERANCE_M
    sparse.optimise()
    whole.optimise()
    stamps = [o.stamp_ns for o in walk[::7]]
    assert distances(sparse.corrected(stamps), whole.corrected(stamps)).max() < 3 * TOLERANCE_M
    assert distances([T for _, T in sparse.path()], [T for _, T in whole.path()]).max() < 3 * TOLERANCE_M
    assert pose_error(sparse.T_map_odom, whole.T_map_odom)[1] < 100 * 3 * TOLERANCE_M
    assert len(sparse.odometry) < len(whole.odometry) / 3


def test_the_correction_belongs_to_the_newest_keyframe() -> None:
    graph = mapped(RIGHT)
    graph.optimise()
    stamp, T_map_body = graph.path()[-1]
    np.testing.assert_allclose(graph.T_map_odom @ graph.odometry.at(stamp), T_map_body, atol=1e-9)


def test_new_keyframes_continue_from_the_corrected_map() -> None:
    graph = mapped(RIGHT)
    graph.optimise()
    correction = graph.T_map_odom
    T_odom_body = BENT[-1] @ pose(np.eye(3), np.array([1.0, 0.0, 0.0]))
    assert graph.add_odometry(Odometry(T_odom_body=T_odom_body, stamp_ns=1000 * SECOND))
    np.testing.assert_allclose(graph.path()[-1][1], correction @ T_odom_body, atol=1e-9)


def test_a_problem_is_solved_aside_while_the_graph_grows() -> None:
    graph = mapped(RIGHT)
    problem = graph.problem()
    assert graph.add_odometry(Odometry(T_odom_body=SIDEWAYS @ BENT[-1], stamp_ns=1000 * SECOND))
    assert not graph.adopt_solution(problem, problem.solve()).pruned
    np.testing.assert_allclose(graph.path()[-1][1], graph.T_map_odom @ SIDEWAYS @ BENT[-1], atol=1e-9)


def test_a_closure_waits_for_its_odometry() -> None:
    graph = PoseGraph()
    assert not graph.add_closure(RIGHT[0])
    for pose_in_time in odometry(BENT):
        graph.add_odometry(pose_in_time)
    assert graph.add_closure(RIGHT[0])


@pytest.mark.parametrize("missing", ["the first", "the second"])
def test_a_closure_waits_while_odometry_knows_but_one_of_its_moments(missing: str) -> None:
    graph, steps = PoseGraph(), range(20, 60) if missing == "the first" else range(20)
    for k in steps:
        graph.add_odometry(odometry(BENT)[k])
    assert not graph.add_closure(closure(TRUE, 10, 40)) and all(tie.closure is None for tie in graph.ties)


def test_a_closure_within_one_keyframe_ties_nothing() -> None:
    graph = PoseGraph(MapperParams(keyframe_translation=10.0, keyframe_rotation=180.0))
    for pose_in_time in odometry(BENT):
        graph.add_odometry(pose_in_time)
    assert graph.add_closure(closure(TRUE, 10, 40)) and graph.ties == []


@pytest.mark.parametrize("to", [29, 30])
def test_a_closure_of_two_runs_of_the_clock_is_refused(to: int) -> None:
    graph, ties = mapped([]), len(mapped([]).ties)
    with pytest.raises(ValueError, match=rf"whose \*from\* is before its \*to\* at {to}00000000 ns, got 30000"):
        graph.add_closure(closure(TRUE, 30, to))
    assert len(graph.ties) == ties


def test_a_closure_within_a_gap_of_the_odometry_ties_nothing() -> None:
    graph, silent = PoseGraph(), range(100, 130)
    for k, sample in enumerate(odometry(TRUE)):
        if k not in silent:
            graph.add_odometry(sample)
    inside = closure(TRUE, 10, 110)
    assert graph.in_gap(inside) and not graph.add_closure(inside)
    assert not graph.in_gap(RIGHT[0]) and graph.add_closure(RIGHT[0])


def test_odometry_that_began_anew_elsewhere_in_a_silence_gives_way_to_closures() -> None:
    """The second lap is given from another origin, as by an odometry that was started again beside the old one."""
    again = pose(rotation_from_vector(np.array([0.0, 0.0, 0.3])), np.array([1.0, -0.5, 0.0]))
    late = [replace(sample, stamp_ns=sample.stamp_ns + 20 * SECOND) for sample in odometry([again @ T for T in TRUE])]
    graph = PoseGraph()
    for sample in (*odometry(TRUE)[:HALF], *late[HALF:]):
        graph.add_odometry(sample)
    for right in RIGHT[1:]:
        assert graph.add_closure(replace(right, to_ns=right.to_ns + 20 * SECOND))
    summary = graph.optimise()
    assert not summary.pruned
    found = graph.corrected([sample.stamp_ns for sample in late[HALF + 5 :]])
    assert distances(found, TRUE[HALF + 5 :]).max() < 0.02


def test_the_place_of_the_camera_on_the_body_is_honoured() -> None:
    """Closures between cameras that look sideways give the same map as closures between bodies."""
    T_body_camera = pose(rotation_from_vector(np.array([-1.2, 1.2, -1.2])), np.array([0.1, 0.0, 0.4]))
    of_body, of_camera = mapped(RIGHT), mapped([])
    for right in RIGHT:
        T_from_to = inverse(T_body_camera) @ right.T_from_to @ T_body_camera
        moved = LoopClosure(
            from_ns=right.from_ns, to_ns=right.to_ns, T_from_to=T_from_to, covariance=right.covariance, labels=()
        )
        assert of_camera.add_closure(moved, T_body_camera)
    of_body.optimise()
    of_camera.optimise()
    assert distances(corrected(of_camera), corrected(of_body)).max() < 0.03
    assert distances(corrected(of_camera), TRUE).max() < 0.3 * distances(BENT, TRUE).max()


def test_a_closure_far_from_its_keyframes_is_known_less_well() -> None:
    graph = mapped([])
    stamps = graph.keyframes.stamps_ns
    steps = [stamp * 10 // SECOND for stamp in (stamps[5], stamps[-5])]
    spreads = []
    for away in (0, 1):
        assert graph.add_closure(closure(TRUE, steps[0] + away, steps[1] + away))
        spreads.append(np.sqrt(np.diag(graph.ties[-1].constraint.covariance)))
    assert (spreads[1] > spreads[0]).all()


def test_keyframes_are_apart_by_the_parameters() -> None:
    near, far = (mapped([], MapperParams(keyframe_translation=d, keyframe_rotation=180.0)) for d in (0.2, 0.8))
    assert len(near.keyframes) > 2.5 * len(far.keyframes)
    steps = [np.linalg.norm((inverse(a) @ b)[:3, 3]) for a, b in pairwise(far.keyframes.poses)]
    assert min(steps) >= 0.8


def test_a_turn_on_the_spot_becomes_a_keyframe_by_its_degrees() -> None:
    graph = PoseGraph(MapperParams(keyframe_rotation=15.0))
    turns = (0.0, 14.0, 16.0, 30.0, 32.0)
    poses = [pose(rotation_from_vector(np.radians([0.0, 0.0, turn])), np.zeros(3)) for turn in turns]
    assert [graph.add_odometry(sample) for sample in odometry(poses)] == [True, False, True, False, True]


def test_time_that_runs_back_is_refused() -> None:
    graph = mapped(RIGHT)
    with pytest.raises(ValueError, match="expected a stamp after"):
        graph.add_odometry(odometry(BENT)[0])


def test_what_closures_say_of_odometry_holds_where_nothing_closes() -> None:
    early = [closure(TRUE, k, k + 30) for k in range(0, 40, 8)]
    plain = mapped(early, MapperParams(steady_heading=0.0, steady_distance=0.0))
    knowing = mapped(early, MapperParams(steady_heading=2.0))
    plain.optimise()
    knowing.optimise()
    assert distances(corrected(knowing), TRUE)[-1] < 0.5 * distances(corrected(plain), TRUE)[-1]


def test_closures_that_are_a_little_wrong_one_way_are_no_evidence_of_a_steady_error() -> None:
    askew = pose(rotation_from_vector(np.array([0.0, 0.0, 0.02])), np.zeros(3))
    straight = [closure(BENT, k, k + 30, askew) for k in range(0, 40, 8)]
    plain, wary = mapped(straight, MapperParams(steady_heading=0.0, steady_distance=0.0)), mapped(straight)
    plain.optimise()
    wary.optimise()
    assert distances(corrected(wary), corrected(plain)).max() < 1e-9


def test_between_keyframes_the_correction_goes_over_from_the_one_to_the_other() -> None:
    graph = PoseGraph(MapperParams(keyframe_translation=1.0))
    for sample in odometry([pose(np.eye(3), np.array([0.25 * k, 0.0, 0.0])) for k in range(9)]):
        graph.add_odometry(sample)
    aside = np.array([pose(np.eye(3), np.array([x, y, 0.0])) for x, y in ((0.0, 0.0), (1.0, 0.1), (2.0, 0.4))])
    chain = Chain.begun(np.eye(4), Steady()).extended(np.array(graph.keyframes.poses), np.full((2, 2), 1e-4))
    trajectory = SolvedTrajectory(chain, (0, 1, 2), aside)
    graph.adopt_solution(graph.problem(), Solution((trajectory,), np.zeros(0, bool), np.zeros(0)))
    found = [T[:2, 3] for T in graph.corrected(o.stamp_ns for o in odometry([np.eye(4)] * 9))]
    expected = [0.0, 0.025, 0.05, 0.075, 0.1, 0.175, 0.25, 0.325, 0.4]
    np.testing.assert_allclose(found, [(0.25 * k, y) for k, y in enumerate(expected)], atol=1e-9)


def test_closures_on_which_gtsam_raises_are_left_out_and_named(monkeypatch: pytest.MonkeyPatch) -> None:
    expected, poison = IncrementalGraph.error_covariance, closure(TRUE, 10, 90, SIDEWAYS)

    def fail(graph: IncrementalGraph, edge: Edges) -> Array:
        if np.linalg.norm(edge.T_1_2[0, :2, 3] - poison.T_from_to[:2, 3]) < 0.3:
            raise RuntimeError("no solution")
        return expected(graph, edge)

    monkeypatch.setattr(IncrementalGraph, "error_covariance", fail)
    clean, dirty = mapped(RIGHT), mapped([RIGHT[0], poison, *RIGHT[1:]])
    clean.optimise()
    summary = dirty.optimise()
    assert summary.pruned == (poison,) and summary.residuals == (np.inf,) and len(summary.kept) == len(RIGHT)
    assert distances(corrected(dirty), corrected(clean)).max() < 0.005
    assert dirty.optimise().pruned == (poison,)


def test_a_withdrawn_closure_is_in_no_map_and_no_summary_any_more() -> None:
    slightly = closure(TRUE, 30, 110, pose(np.eye(3), np.array([0.06, 0.0, 0.0])))
    clean, graph = mapped(RIGHT), mapped([slightly, *RIGHT])
    clean.optimise()
    assert slightly in graph.optimise().kept
    assert graph.withdraw(lambda known: known is slightly) == 1 and graph.withdraw(lambda known: known is slightly) == 0
    summary = graph.optimise()
    assert slightly not in (*summary.kept, *summary.pruned) and len(summary.kept) == len(RIGHT)
    assert slightly not in [tie.closure for tie in graph.ties] and len(graph.closure_ties) == len(RIGHT)
    assert distances(corrected(graph), corrected(clean)).max() < 0.005


# Sessions

ELSEWHERE = pose(rotation_from_vector(np.array([0.0, 0.0, 0.7])), np.array([5.0, -3.0, 0.0]))
LAPS = TRUE[:HALF], TRUE[HALF:]


def two_sessions(second: int | None = 2) -> PoseGraph:
    """A lap, and the same lap again by the same clock and from another origin."""
    graph = PoseGraph()
    for sample in odometry(LAPS[0]):
        graph.add_odometry(sample)
    graph.begin_session(second)
    for sample in odometry([ELSEWHERE @ T for T in LAPS[1]]):
        graph.add_odometry(sample)
    return graph


def across(a: int, b: int, sessions: tuple[int | None, int | None] = (1, 2)) -> LoopClosure:
    """A perfect closure of a step of the first lap and one of the second."""
    moments = {"from_ns": a * SECOND // 10, "to_ns": b * SECOND // 10}
    closed = replace(closure(TRUE, a, HALF + b), **moments)
    return replace(closed, from_session=sessions[0], to_session=sessions[1])


def test_two_runs_of_one_clock_are_distinguished_by_their_sessions() -> None:
    graph = two_sessions()
    for a, b in ((40, 10), (20, 21), (70, 72)):
        assert graph.add_closure(across(a, b))
    summary = graph.optimise()
    assert len(summary.kept) == 3 and graph.is_placed
    assert [one.names for one in graph.sessions] == [{1}, {2}]
    found = graph.corrected(sample.stamp_ns for sample in odometry(LAPS[1]))
    assert distances(found, LAPS[1]).max() < 0.03


@pytest.mark.parametrize(("sessions", "second"), [((None, None), 2), ((1, 2), None)])
def test_two_runs_of_one_clock_that_nothing_distinguishes_are_refused(
    sessions: tuple[int | None, int | None], second: int | None
) -> None:
    graph = two_sessions(second)
    with pytest.raises(ValueError, match="expected a constraint that names its sessions, as 2 runs of odometry have"):
        graph.add_closure(across(20, 21, sessions))
    assert not graph.closure_ties


def test_a_registrar_that_begins_a_session_where_odometry_goes_on_is_followed_all_the_same() -> None:
    graph = mapped([])
    names = (0, 0), (0, 1), (1, 1)
    for k, (one, other) in enumerate(names):
        assert graph.add_closure(replace(RIGHT[k], from_session=one, to_session=other))
    assert graph.sessions[0].names == {0, 1}


def test_a_closure_that_is_refused_names_no_session() -> None:
    graph = mapped([])
    far = closure(TRUE, 10, 90, pose(np.eye(3), np.array([600.0, 0.0, 0.0])))
    with pytest.raises(ImplausibleError):
        graph.add_closure(replace(far, from_session=9, to_session=9))
    assert graph.sessions[0].names == set()


def test_a_moment_that_the_run_of_now_has_yet_to_come_to_is_not_that_of_the_run_before() -> None:
    graph = PoseGraph()
    for sample in odometry(LAPS[0]):
        graph.add_odometry(sample)
    assert graph.add_closure(replace(closure(TRUE, 5, 30), from_session=1, to_session=1))
    graph.begin_session()
    for sample in odometry([ELSEWHERE @ T for T in LAPS[1][:20]]):
        graph.add_odometry(sample)
    early = replace(closure(TRUE, 3, 40), from_session=2, to_session=2)
    assert not graph.add_closure(early)
    with pytest.raises(ValueError, match="names its sessions"):
        graph.add_closure(closure(TRUE, 3, 40))


def test_a_session_leaves_the_map_with_the_closures_that_placed_it() -> None:
    graph = two_sessions()
    for a, b in ((20, 21), (60, 62)):
        assert graph.add_closure(across(a, b))
    graph.optimise()
    assert graph.is_placed
    graph.withdraw(lambda one: one.from_ns == 2 * SECOND)
    assert graph.add_closure(across(40, 41))
    graph.optimise()
    assert graph.is_placed  # two are left
    graph.withdraw(lambda one: one.from_ns == 4 * SECOND)
    summary = graph.optimise()
    assert not graph.is_placed and not summary.kept
    np.testing.assert_array_equal(graph.T_map_odom, np.eye(4))
    assert all(len(part) == 0 for part in graph.edges())


def test_a_session_that_one_closure_ties_waits_for_another() -> None:
    graph = two_sessions()
    assert graph.add_closure(across(20, 21))
    summary = graph.optimise()
    assert not graph.is_placed and not summary.kept and not summary.pruned
    assert [len(path) > 0 for path in graph.paths()] == [True, False]
    np.testing.assert_array_equal(graph.T_map_odom, np.eye(4))
    assert graph.add_closure(across(60, 62))
    assert len(graph.optimise().kept) == 2 and graph.is_placed and all(graph.paths())


def test_sessions_by_different_clocks_need_no_names() -> None:
    graph = PoseGraph()
    for sample in odometry(LAPS[0]):
        graph.add_odometry(sample)
    graph.begin_session()
    for k, sample in enumerate(odometry([ELSEWHERE @ T for T in LAPS[1]])):
        graph.add_odometry(replace(sample, stamp_ns=(HALF + k) * SECOND // 10 + SECOND))
    for a, b in ((20, 101), (60, 141)):
        closed = closure(TRUE, a, b)
        assert graph.add_closure(replace(closed, to_ns=closed.to_ns + SECOND))
    assert len(graph.optimise().kept) == 2 and graph.is_placed


def test_any_session_is_asked_by_its_number_for_its_moments() -> None:
    graph = two_sessions()
    assert graph.is_in_map(0) and not graph.is_in_map(1)
    for a, b in ((20, 21), (60, 61)):
        assert graph.add_closure(across(a, b))
    graph.optimise()
    assert graph.is_in_map(1)
    stamps = [k * SECOND // 10 for k in range(3)]
    np.testing.assert_array_equal(graph.corrected(stamps, session=1), graph.corrected(stamps))
    np.testing.assert_allclose(graph.corrected(stamps, session=0)[0], LAPS[0][0], atol=0.01)


def test_a_session_of_no_odometry_is_none() -> None:
    graph = PoseGraph()
    graph.begin_session(3)
    assert [one.names for one in graph.sessions] == [{3}] and graph.is_placed
    for sample in odometry(LAPS[0]):
        graph.add_odometry(sample)
    graph.begin_session(4)
    graph.begin_session(5)
    assert [one.names for one in graph.sessions] == [{3}, {5}] and not graph.is_placed


def test_the_keyframes_of_sessions_are_numbered_in_one_row_once_they_are_in_the_map() -> None:
    graph = two_sessions()
    first, second = (len(one.keyframes) for one in graph.sessions)
    for a, b in ((20, 21), (60, 62)):
        assert graph.add_closure(across(a, b))
    poses, edges = graph.flat()
    assert {session for _, session in graph.flat_times()} == {0} and len(graph.flat_times()) == first
    assert len(poses) == first and [edge[:2] for edge in edges] == [(k, k + 1) for k in range(first - 1)]
    graph.optimise()
    poses, edges = graph.flat()
    rows = [*range(first - 1), *range(first, first + second - 1)]
    times = [(stamp, n) for n, one in enumerate(graph.sessions) for stamp in one.keyframes.stamps_ns]
    assert graph.flat_times() == times and len(times) == len(poses)
    assert len(poses) == first + second and [edge[:2] for edge in edges[:-2]] == [(k, k + 1) for k in rows]
    for k1, k2, constraint in edges:
        assert pose_error(inverse(poses[k1]) @ poses[k2], constraint.T_from_to)[1] < 10.0
    assert all(k1 < first <= k2 for k1, k2, _ in edges[-2:])
