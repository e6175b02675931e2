# SPDX-License-Identifier: Apache-2.0
"""Jitter of odometry, from differences between poses that are sure."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.data.checked import Array
from objreg_ros.keyframes.jitter import LEAST_PAIRS, STEADY, Jitter, JitterMeter

NONE = np.zeros((400, 2))


def differences(rms: tuple[float, float], count: int = 400, seed: int = 0) -> Array:
    """(N, 2) lengths of normal vectors of that root mean square."""
    vectors = np.random.default_rng(seed).standard_normal((count, 2, 3)) / np.sqrt(3.0)
    return np.asarray(np.linalg.norm(vectors, axis=2) * rms)


def measured(found: Array, explained: Array = NONE, ends: int = 4) -> Jitter:
    meter = JitterMeter()
    meter.add_differences(found, explained[: len(found)], np.full(len(found), ends))
    return meter.jitter


@pytest.mark.parametrize(("ends", "rms"), [(4, (6.0, 0.08)), (2, (6.0 / 2**0.5, 0.08 / 2**0.5))])
def test_each_pose_of_odometry_between_two_pairs_adds_its_share(ends: int, rms: tuple[float, float]) -> None:
    assert measured(differences(rms), ends=ends) == pytest.approx((3.0, 0.04), rel=0.15)


def test_what_the_poses_are_unsure_of_is_no_jitter() -> None:
    explained = np.tile(np.square([2.0, 0.05]), (400, 1))
    assert measured(differences((1.5, 0.03)), explained) == STEADY
    both = differences((40.0**0.5, (0.08**2 + 0.05**2) ** 0.5))
    assert measured(both, explained) == pytest.approx((3.0, 0.04), rel=0.2)


def test_four_of_ten_differences_that_are_wrong_move_it_little() -> None:
    wrong = np.vstack((differences((6.0, 0.08), 240), np.tile([90.0, 2.0], (160, 1))))
    assert measured(wrong) == pytest.approx((3.0, 0.04), rel=0.35)


def test_few_pairs_measure_nothing() -> None:
    assert measured(differences((6.0, 0.08), LEAST_PAIRS - 1)) == STEADY
    assert measured(differences((6.0, 0.08), LEAST_PAIRS)) != STEADY


def test_two_pairs_of_the_same_keyframes_measure_nothing() -> None:
    assert measured(differences((6.0, 0.08)), ends=0) == STEADY


def test_jitter_excuses_no_more_than_8_degrees_and_15_cm() -> None:
    assert STEADY.allowance() == STEADY
    assert Jitter(1.0, 0.02).allowance() == pytest.approx((4.0, 0.08))
    assert Jitter(30.0, 1.0).allowance() == (8.0, 0.15)
