# SPDX-License-Identifier: Apache-2.0
"""The long run through ever new places, and the slope of what it takes."""

from __future__ import annotations

from itertools import pairwise
from types import ModuleType

import numpy as np
import pytest
from registration.samples import box, frame

from objreg_ros.geometry import leaps
from objreg_ros.registrar.params import RegistrarParams

PASS = [frame(0.1 * k, (box("cup", (0, 0, 1)),), np.eye(4)) for k in range(40)]


@pytest.fixture
def memory() -> ModuleType:
    """The script."""
    import memory

    return memory


def test_the_stream_lasts_as_long_as_is_asked_and_goes_on_in_one_session(memory: ModuleType) -> None:
    frames = list(memory.stream([PASS, PASS], 0.05))
    assert 3 * memory.MINUTE_NS <= frames[-1].stamp_ns < 4 * memory.MINUTE_NS
    most = RegistrarParams().max_speed
    assert most > memory.SPEED
    for before, after in pairwise(frames):
        seconds = 1e-9 * (after.stamp_ns - before.stamp_ns)
        assert seconds > 0
        assert before.T_odom_camera is not None and after.T_odom_camera is not None
        assert not leaps(before.T_odom_camera, after.T_odom_camera, seconds, most, np.eye(4))


def test_most_passes_are_at_new_places_and_some_at_places_of_before(memory: ModuleType) -> None:
    places = [
        one.T_odom_camera[0, 3] for one in memory.stream([PASS], 0.1) if one.objects and one.T_odom_camera is not None
    ]
    begun = [there for before, there in zip([None, *places], places, strict=False) if there != before]
    assert 0.7 < len(set(begun)) / len(begun) < 0.9


@pytest.mark.parametrize("slope", [0.0, 0.5])
def test_the_slope_is_that_of_the_run_once_it_has_settled(memory: ModuleType, slope: float) -> None:
    rows = [{"minute": k, "rss_mb": (200.0 if k > 30 * memory.SETTLED else 10.0 * k) + slope * k} for k in range(1, 31)]
    assert memory.mb_per_hour(rows) == pytest.approx(60 * slope, abs=1e-6)


def test_a_process_has_memory_of_its_own(memory: ModuleType) -> None:
    taken = memory.memory_mb()
    assert taken["rss_mb"] >= taken["pss_mb"] > 10
