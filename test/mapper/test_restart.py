# SPDX-License-Identifier: Apache-2.0
"""Odometry goes on, errs once, or begins anew."""

from __future__ import annotations

import numpy as np

from objreg_mapper.restart import Admitted, Anew, Restart
from objreg_ros.data.frames import Odometry
from objreg_ros.geometry import pose

SECOND = 1_000_000_000


def at(seconds: float, x: float) -> Odometry:
    return Odometry(T_odom_body=pose(np.eye(3), np.array([x, 0.0, 0.0])), stamp_ns=int(seconds * SECOND))


def fed(*samples: Odometry) -> tuple[list[Admitted], list[Odometry]]:
    wrong: list[Odometry] = []
    restart = Restart(5.0, wrong.append)
    return [restart.admit(sample) for sample in samples], wrong


BEFORE = [at(10.0, 4.0), at(10.1, 4.1)]


def test_one_pose_that_leaps_and_comes_back_is_wrong() -> None:
    outlier, back = at(10.2, 40.0), at(10.3, 4.2)
    admitted, wrong = fed(*BEFORE, outlier, back)
    assert [each.poses for each in admitted[2:]] == [(), (back,)] and wrong == [outlier]


def test_two_stale_ones_are_wrong() -> None:
    stale, on = [at(3.0, 1.0), at(3.1, 1.1)], at(10.2, 4.2)
    admitted, wrong = fed(*BEFORE, *stale, on)
    assert admitted[-1] == Admitted((on,)) and wrong == stale


def test_three_that_agree_begin_anew_and_none_of_them_is_lost() -> None:
    for anew, samples in (
        (Anew.PLACE, (at(10.2, 40.0), at(10.3, 40.1), at(10.4, 40.2))),
        (Anew.TIME, (at(1.0, 0.0), at(1.1, 0.1), at(1.2, 0.2))),
    ):
        admitted, wrong = fed(*BEFORE, *samples)
        assert admitted[-1] == Admitted(samples, anew) and not wrong


def test_a_robot_that_is_back_at_its_origin_after_a_silence_begins_anew_though_it_drives_off_at_once() -> None:
    samples = (at(30.0, 0.0), at(30.1, 0.05), at(30.2, 0.1))
    admitted, wrong = fed(*BEFORE, *samples)
    assert admitted[-1] == Admitted(samples, Anew.PLACE) and not wrong


def test_three_that_disagree_among_themselves_begin_nothing() -> None:
    admitted, wrong = fed(*BEFORE, at(10.2, 40.0), at(10.3, 80.0), at(10.4, -40.0), at(10.5, 4.3))
    assert [each.anew for each in admitted] == [None] * 6 and len(wrong) == 3


def test_time_that_goes_far_ahead_goes_on_with_the_map() -> None:
    samples = (at(100.0, 4.2), at(100.1, 4.3), at(100.2, 4.4))
    admitted, _ = fed(*BEFORE, *samples)
    assert admitted[-1] == Admitted(samples)


def test_one_that_comes_late_is_wrong_alone() -> None:
    late = at(10.05, 4.05)
    admitted, wrong = fed(*BEFORE, late)
    assert admitted[-1] == Admitted() and wrong == [late]
