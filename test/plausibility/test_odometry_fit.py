# SPDX-License-Identifier: Apache-2.0
"""Turns show whether odometry is of the robot that carries the camera, and of the same time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverses, pose, rotation_from_vector
from objreg_ros.plausibility.odometry_fit import LEAST_SHIFT_S, LEAST_TURNS, find_shift, likeness
from objreg_ros.plausibility.odometry_track import OdometryTrack
from plausibility.box_room import odometry, swinging
from plausibility.moving import MOUNT, carried, random_motions

BODY = random_motions(20, turn=0.2)
FIRST_S = np.arange(20.0, 40.0, 0.5)
STAMPS_NS = np.rint(1e9 * np.array([FIRST_S, FIRST_S + 0.45])).astype(np.int64)
T_CAMERA = inverses(swinging(FIRST_S)) @ swinging(FIRST_S + 0.45)


def test_turns_of_one_body_are_alike_under_any_mount() -> None:
    found = likeness(BODY, carried(BODY))
    assert found.is_alike and not found.is_unlike
    assert found.share == 1.0 and found.turns == len(BODY) and found.off < 1e-6


def test_turns_are_alike_under_the_mount_that_is_named_and_no_other() -> None:
    assert likeness(BODY, carried(BODY), MOUNT[:3, :3]).share == 1.0
    assert likeness(BODY, carried(BODY), np.eye(3)).is_unlike


def test_turns_of_two_bodies_are_unlike() -> None:
    found = likeness(BODY, carried(random_motions(20, seed=8, turn=0.2)))
    assert found.is_unlike and not found.is_alike and found.off > 0.5


def test_small_turns_say_nothing() -> None:
    small = random_motions(20, turn=0.005)
    found = likeness(small, carried(small))
    assert found.turns == 0 and not found.is_alike and not found.is_unlike
    assert not likeness(BODY[:0], BODY[:0]).is_alike


def test_few_turns_are_of_neither_one_body_nor_two() -> None:
    few, other = BODY[: LEAST_TURNS - 1], carried(random_motions(LEAST_TURNS - 1, seed=8, turn=0.2))
    assert likeness(few, carried(few)).share == 1.0 and not likeness(few, carried(few)).is_alike
    assert not likeness(few, other, MOUNT[:3, :3]).is_unlike


def of_body(late_s: float, pace: float = 1.0, until_s: float = 60.0) -> Callable[[float], tuple[Array, Array]]:
    """The motions of the body that carries the camera, by odometry that is stamped so much later."""
    seconds = np.arange(0.0, until_s, 0.05)
    track = OdometryTrack()
    for sample in odometry(seconds, swinging(seconds, pace), late_s):
        track.add_odometry(sample)

    def motions(later_s: float) -> tuple[Array, Array]:
        (first, known), (last, also) = (track.at(stamps_ns + round(1e9 * later_s)) for stamps_ns in STAMPS_NS)
        return inverses(first) @ last, known & also

    return motions


@pytest.mark.parametrize("late_s", [7.3, -4.1])
def test_odometry_of_another_clock_is_found_with_its_shift(late_s: float) -> None:
    found = find_shift(of_body(late_s), T_CAMERA)
    assert found is not None and found.seconds == pytest.approx(late_s, abs=0.03)
    assert found.likeness.share == 1.0 and found.likeness.is_alike


def test_a_shift_of_more_than_a_minute_is_found_where_it_is_known_about() -> None:
    assert find_shift(of_body(107.3), T_CAMERA) is None
    found = find_shift(of_body(107.3), T_CAMERA, about_s=100.0)
    assert found is not None and found.seconds == pytest.approx(107.3, abs=0.03)


def test_turns_of_another_robot_have_no_shift() -> None:
    assert find_shift(of_body(0.0, pace=1.7), T_CAMERA) is None


@pytest.mark.parametrize("late_s", [0.0, LEAST_SHIFT_S / 2])
def test_odometry_of_the_same_clock_has_no_shift(late_s: float) -> None:
    assert find_shift(of_body(late_s), T_CAMERA) is None


def turned(about_z: Array) -> Array:
    turns = np.zeros((len(about_z), 3))
    turns[:, 2] = about_z
    return pose(rotation_from_vector(turns), np.zeros(3))


def test_turns_that_come_again_show_no_shift() -> None:
    noise = np.random.default_rng(6).normal(0, 0.005, len(FIRST_S))
    all_known = np.ones(len(FIRST_S), bool)

    def swung(later_s: float) -> Array:
        return 0.3 * np.sin(2.0 * np.pi * (FIRST_S + later_s) / 4.0)

    assert find_shift(lambda later_s: (turned(swung(later_s)), all_known), turned(swung(1.0) + noise)) is None


def test_odometry_that_is_never_there_has_no_shift() -> None:
    assert find_shift(lambda _: (np.zeros((len(T_CAMERA), 4, 4)), np.zeros(len(T_CAMERA), bool)), T_CAMERA) is None
