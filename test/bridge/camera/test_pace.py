# SPDX-License-Identifier: Apache-2.0
"""Streams of pictures by their stamps, and which of them go on."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.bridge.camera.pace import TURN, RateLimit

MS = 1_000_000


def admitted(limit: RateLimit, stamps_ms: np.ndarray) -> list[int]:
    return [k for k, stamp in enumerate(stamps_ms) if limit.admits(round(stamp * MS))]


@pytest.mark.parametrize("jitter_ms", [0.0, 2.0, 4.0])
def test_thirty_pictures_a_second_give_every_third(jitter_ms: float) -> None:
    jitter = np.random.default_rng(1).uniform(-jitter_ms, jitter_ms, 3 * TURN)
    assert admitted(RateLimit(10.0), 1000 + np.arange(3 * TURN) * 1000 / 30 + jitter) == list(range(0, 3 * TURN, 3))


def test_fifteen_pictures_a_second_give_two_of_three() -> None:
    chosen = admitted(RateLimit(10.0), 1000 + np.arange(150) * 1000 / 15)
    assert 85 <= len(chosen) <= 100 and max(np.diff(chosen)) <= 3


@pytest.mark.parametrize("every", [2, 3])
def test_depth_that_comes_with_every_second_or_third_picture_meets_some_that_go_on(every: int) -> None:
    for first in range(every):
        chosen = admitted(RateLimit(10.0), 1000 + np.arange(300) * 1000 / 30)
        met = [k for k in chosen if k % every == first]
        assert len(met) > 0.2 * len(chosen)


@pytest.mark.parametrize("rate", [1.0, 7.5, 10.0])
def test_a_slow_camera_gives_all(rate: float) -> None:
    jitter = np.random.default_rng(2).uniform(-4, 4, 50)
    assert admitted(RateLimit(10.0), 1000 + np.arange(50) * 1000 / rate + jitter) == list(range(50))


def test_a_rate_of_nothing_gives_all() -> None:
    assert admitted(RateLimit(0.0), np.arange(20) * 5.0) == list(range(20))
    assert admitted(RateLimit(0.0), np.array([500.0, 400.0, 450.0, 1e9, 10.0])) == list(range(5))


def test_the_first_picture_after_a_jump_goes_on_whatever_was_left_out_before() -> None:
    limit = RateLimit(10.0)
    admitted(limit, 90_000 + np.arange(3 * TURN - 1) * 1000 / 30)
    assert limit.admits(1000 * MS)


def test_a_clock_that_jumps_back_begins_anew() -> None:
    assert admitted(RateLimit(10.0), np.array([9000, 9033, 100, 133, 166, 200])) == [0, 2, 5]


def test_a_picture_that_comes_a_little_late_is_left_out() -> None:
    assert admitted(RateLimit(10.0), np.array([1000, 1100, 1033, 1200])) == [0, 1, 3]


def test_one_stamp_far_ahead_stops_nothing() -> None:
    assert admitted(RateLimit(10.0), np.array([1000, 1e9, 1100, 1133, 1200])) == [0, 1, 2, 4]


def test_a_clock_that_stands_still_gives_all() -> None:
    assert admitted(RateLimit(10.0), np.zeros(5)) == list(range(5))
