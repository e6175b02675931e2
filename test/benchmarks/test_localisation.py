# SPDX-License-Identifier: Apache-2.0
"""How kidnappings are made and counted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from registration.samples import frame, moved

from objreg_ros.geometry import inverse

LEVEL = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1], [0, 0, 0, 1]])  # looks along x, z is up


def test_odometry_and_stamps_carry_on_over_a_splice_and_the_truth_does_not() -> None:
    from localisation import spliced

    frames = [replace(frame(k, ()), T_odom_camera=moved(k) @ LEVEL) for k in range(9)]
    plan = spliced(frames, 4, 7)
    assert [one.stamp_ns for one in plan.frames] == [k * 10**9 for k in range(6)]
    assert plan.true_ns == [k * 10**9 for k in (0, 1, 2, 3, 7, 8)] and plan.cut == 4
    before, at, after = (plan.frames[k].T_odom_camera for k in (3, 4, 5))
    assert before is not None and at is not None and after is not None
    assert np.allclose(before, at) and np.allclose((inverse(at) @ after)[:3, 3], [0, 0, 1])


def test_only_kidnappings_that_could_be_noticed_count_and_alarms_are_counted_an_hour() -> None:
    from localisation import Tally, summary

    rows = [
        {"kind": "map", "counts": True, "in_time": True},
        {"kind": "map", "counts": True, "in_time": False},
        {"kind": "alone", "counts": False, "in_time": False},
    ]
    found = summary([Tally(rows, 1800.0, ["why"], [(0.95, True), (0.95, False)])])
    assert (found["made"], found["counted"], found["share"]) == (3, 2, 0.5)
    assert found["alarms_an_hour"] == pytest.approx(2.0)
    assert found["reliability"] == [{"from": 0.9, "to": 0.99, "answers": 2, "stated": 0.95, "right": 0.5}]
