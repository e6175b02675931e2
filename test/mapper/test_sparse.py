# SPDX-License-Identifier: Apache-2.0
"""What is left out of a trajectory is given back."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_mapper.sparse import TOLERANCE_DEG, TOLERANCE_M, SparseTrajectory
from objreg_ros.data.checked import Array
from objreg_ros.geometry import pose, pose_error, rotation_from_vector

from .bent import SECOND

STEP_NS = SECOND // 200
RNG = np.random.default_rng(3)


def at(xyz: list[float], turn: list[float]) -> Array:
    return pose(rotation_from_vector(np.array(turn)), np.array(xyz))


def kept_of(poses: list[Array], pins: tuple[int, ...] = ()) -> SparseTrajectory:
    trajectory = SparseTrajectory()
    for k, T in enumerate(poses):
        trajectory.append(k * STEP_NS, T)
        if k in pins:
            trajectory.pin()
    return trajectory


def walk(seconds: float = 10.0) -> list[Array]:
    """A robot that speeds up, slows down, bobs and turns, its odometry trembling a little."""
    times = np.arange(0.0, seconds, 0.005)
    tremble = 5e-5 * RNG.standard_normal((len(times), 6))
    return [
        at([np.sin(t) + n[0], 0.2 * np.sin(3 * t) + n[1], 0.005 * np.sin(9 * t) + n[2]], [n[3], 0.1 * np.cos(t), 2 * t])
        for t, n in zip(times, tremble, strict=True)
    ]


@pytest.mark.parametrize("tremble", [0.0, 1e-4])
def test_a_body_at_rest_costs_two_poses_however_long_it_rests(tremble: float) -> None:
    shakes = np.clip(tremble * RNG.standard_normal((20_000, 6)), -2e-4, 2e-4)
    trajectory = kept_of([at(list(shake[:3]), list(shake[3:])) for shake in shakes])
    assert (len(trajectory), trajectory.stamps_ns[-1]) == (2, 19_999 * STEP_NS)


def test_every_pose_of_a_walk_is_given_back_within_a_millimetre_and_a_twentieth_of_a_degree() -> None:
    poses = walk()
    trajectory = kept_of(poses)
    errors = np.array([pose_error(trajectory.at(k * STEP_NS), T) for k, T in enumerate(poses)])
    assert errors[:, 0].max() <= TOLERANCE_DEG and errors[:, 1].max() <= 100 * TOLERANCE_M
    assert errors[:, 1].max() > 0.01  # something was left out
    assert len(trajectory) < len(poses) / 4


def test_moments_in_a_gap_are_not_covered_and_its_ends_are() -> None:
    trajectory, silent_ns = SparseTrajectory(), 20 * SECOND
    for stamp_ns in (*range(0, SECOND, STEP_NS), *range(silent_ns, silent_ns + SECOND, STEP_NS)):
        trajectory.append(stamp_ns, at([1e-9 * stamp_ns, 0.0, 0.0], [0.0, 0.0, 0.0]))
    inside, ends = [SECOND, silent_ns - 1], [SECOND - STEP_NS, silent_ns, silent_ns + STEP_NS]
    assert all(trajectory.in_gap(stamp) and not trajectory.covers(stamp) for stamp in inside)
    assert all(trajectory.covers(stamp) and not trajectory.in_gap(stamp) for stamp in ends)
    longest = trajectory.silent_s(0, 1000 * SECOND)
    assert longest > 0.0 and trajectory.silent_s(ends[0], ends[0]) == 0.0
    assert trajectory.at(silent_ns)[0, 3] == pytest.approx(20.0)
    assert {SECOND - STEP_NS, silent_ns} <= set(trajectory.stamps_ns)


def test_poses_that_always_come_seldom_have_no_gaps() -> None:
    trajectory = SparseTrajectory()
    for k in range(20):
        trajectory.append(3 * k * SECOND, at([0.1 * k, 0.0, 0.0], [0.0, 0.0, 0.0]))
    assert trajectory.covers(10 * SECOND)
    trajectory.append(100 * SECOND, at([2.0, 0.0, 0.0], [0.0, 0.0, 0.0]))
    assert trajectory.in_gap(80 * SECOND) and not trajectory.in_gap(SECOND)


def test_poses_that_begin_to_come_seldom_have_gaps_for_a_while_only() -> None:
    trajectory = SparseTrajectory()
    for stamp_ns in (0, STEP_NS, *range(2 * SECOND, 100 * SECOND, 2 * SECOND)):
        trajectory.append(stamp_ns, at([0.0, 0.0, 0.0], [0.0, 0.0, 0.0]))
    assert trajectory.in_gap(SECOND) and not any(map(trajectory.in_gap, range(20 * SECOND, 98 * SECOND, SECOND)))


def test_what_lies_behind_a_first_pose_that_has_no_time_is_not_covered() -> None:
    trajectory, begins_ns = SparseTrajectory(), 10**9 * SECOND
    for stamp_ns in (0, *range(begins_ns, begins_ns + SECOND, STEP_NS)):
        trajectory.append(stamp_ns, at([0.0, 0.0, 0.0], [0.0, 0.0, 0.0]))
    assert not trajectory.covers(begins_ns - 3600 * SECOND) and trajectory.covers(begins_ns + STEP_NS // 2)
    trajectory.append(begins_ns + 4 * SECOND, at([0.0, 0.0, 0.0], [0.0, 0.0, 0.0]))
    assert trajectory.in_gap(begins_ns + 2 * SECOND)


def test_the_first_the_newest_and_what_is_pinned_stay_as_they_are() -> None:
    poses, pins = [at([0.001 * k, 0.0, 0.0], [0.0, 0.0, 0.0]) for k in range(400)], (100, 101, 250)
    trajectory = kept_of(poses, pins)
    assert [stamp // STEP_NS for stamp in trajectory.stamps_ns] == [0, *pins, 399]
    for k in (0, *pins, 399):
        np.testing.assert_array_equal(trajectory.at(k * STEP_NS), poses[k])


def test_a_steady_spin_is_given_back_beyond_half_a_turn() -> None:
    poses = [at([0.0, 0.0, 0.0], [0.0, 0.0, 0.01 * k]) for k in range(2000)]  # more than three turns
    trajectory = kept_of(poses)
    assert max(pose_error(trajectory.at(k * STEP_NS), T)[0] for k, T in enumerate(poses)) <= TOLERANCE_DEG
    assert 7 <= len(trajectory) <= 9  # one for every half turn


def test_a_jump_after_a_long_rest_is_where_it_was() -> None:
    poses = [np.eye(4)] * 1000 + [at([0.1, 0.0, 0.0], [0.0, 0.0, 0.0])] * 1000
    trajectory = kept_of(poses)
    assert [stamp // STEP_NS for stamp in trajectory.stamps_ns] == [0, 999, 1000, 1999]


def test_time_that_does_not_advance_is_refused_and_changes_nothing() -> None:
    trajectory = kept_of([np.eye(4)] * 10)
    with pytest.raises(ValueError, match="expected a stamp after 45000000 ns, got 45000000 ns"):
        trajectory.append(9 * STEP_NS, at([1.0, 0.0, 0.0], [0.0, 0.0, 0.0]))
    assert trajectory.stamps_ns == [0, 9 * STEP_NS]
