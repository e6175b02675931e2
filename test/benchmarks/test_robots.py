# SPDX-License-Identifier: Apache-2.0
"""Tests of how robots in the same rooms are tied and judged, on two that stand side by side."""

from __future__ import annotations

import importlib
from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.geometry import pose
from objreg_tools.simulation.drawn_place import drawn
from objreg_tools.truth import Truth, Truths

SECOND = 10**9


@pytest.fixture
def robots() -> ModuleType:
    return importlib.import_module("robots")


def at(x: float) -> Array:
    return pose(np.eye(3), np.array([x, 0.0, 0.0]))


def closure(robots: tuple[str, str], from_s: int, to_s: int, T_from_to: Array) -> LoopClosure:
    return LoopClosure(
        from_ns=from_s * SECOND,
        to_ns=to_s * SECOND,
        T_from_to=T_from_to,
        covariance=np.eye(6) * 1e-4,
        labels=(),
        from_robot=robots[0],
        to_robot=robots[1],
    )


def team(robots: ModuleType) -> dict[str, object]:
    """Robot a begins at 0 m and b at 1 m of the world, a second later; both go 10 cm a second, and odometry says so."""
    made = {}
    for name, begin_s, start in (("a", 0, 0.0), ("b", 1, 1.0)):
        stamps = [(begin_s + k) * SECOND for k in range(0, 6, 2)]
        ways = [0.1 * k for k in range(0, 6, 2)]
        frames = [
            replace(drawn(stamp), robot=name, T_odom_camera=at(way)) for stamp, way in zip(stamps, ways, strict=True)
        ]
        made[name] = robots.Robot(frames, Truth((s, at(start + way)) for s, way in zip(stamps, ways, strict=True)))
    return made


def test_the_frames_of_all_come_by_their_stamps(robots: ModuleType) -> None:
    assert [(frame.robot, frame.stamp_ns // SECOND) for frame in robots.in_order(team(robots))] == [
        ("a", 0), ("b", 1), ("a", 2), ("b", 3), ("a", 4), ("b", 5),
    ]  # fmt: skip


def test_ties_between_robots_become_true_and_those_of_one_stay(robots: ModuleType) -> None:
    both = team(robots)
    truths = Truths({name: robot.truth for name, robot in both.items()})
    own, tie = closure(("a", "a"), 0, 4, at(9.0)), closure(("a", "b"), 0, 1, at(9.0))
    unknown = closure(("a", "b"), 0, 99, at(9.0))
    found = robots.with_perfect_ties([own, tie, unknown], truths)
    assert found[0] is own and found[2] is unknown
    assert found[1].T_from_to[:3, 3] == pytest.approx([1.0, 0.0, 0.0]) and found[1].robots == ("a", "b")
    assert np.trace(found[1].covariance) < np.trace(tie.covariance)


def test_the_map_of_all_is_as_true_as_two_ties_are_and_none_with_one(robots: ModuleType) -> None:
    pytest.importorskip("gtsam", reason="maps are solved by GTSAM")

    def error_cm(*ties: tuple[int, int, float]) -> float | None:
        closures = [closure(("a", "b"), from_s, to_s, at(metres)) for from_s, to_s, metres in ties]
        return robots.map_error_cm(team(robots), closures)

    assert error_cm((0, 1, 1.0)) is None, "the mapper does not place a robot by one tie"
    assert error_cm((0, 1, 1.0), (4, 5, 1.0)) == pytest.approx(0.0, abs=0.01)
    assert error_cm((0, 1, 1.1), (4, 5, 1.1)) == pytest.approx(5.0, abs=0.2), "half of 10 cm on either side"


def test_each_robot_makes_keyframes_under_its_name(robots: ModuleType) -> None:
    made = list(robots.arrivals(team(robots)))
    assert {arrival.keyframe.robot for arrival in made} == {"a", "b"}
    assert sorted(a.keyframe.stamp_ns for a in made) != [] and all(a.keyframe.objects for a in made)


def test_a_way_is_reported_in_one_line(robots: ModuleType) -> None:
    between = {
        "constraints": 3,
        "false": 1,
        "stretches": {"closed": 2, "of": 9},
        "keyframes": {"closed": 4, "of": 30},
    }
    row = {"constraints": 8, "false": 2, "between": between, "map_cm": 4.04, "perfect_ties_cm": None}
    line = robots.line("seed1 packed", {**row, "alone_cm": {"a": 1.25, "b": None}})
    assert line.startswith("seed1 packed") and "8 constraints, 2 false; between robots 3 (1 false)" in line
    assert "stretches 2/9, keyframes 4/30; map 4.0 cm, perfect ties - cm, alone 1.2, - cm" in line


def test_each_its_own_ties_the_robots_and_says_what_it_sent(robots: ModuleType) -> None:
    two = team(robots)
    closures, said = robots.each_its_own(two, 0.0)
    between = [closure for closure in closures if closure.from_robot != closure.to_robot]
    assert between and all(closure.from_ns < closure.to_ns for closure in between)
    for name, seconds in (("a", 5), ("b", 4)):
        counters = said["counters"][name]
        assert said["kB_per_s"][name] == pytest.approx(1e-3 * counters["bytes sent"] / seconds)
        assert counters["summaries sent"] == 3 and said["waiting"][name] == 0
    assert 200 < said["summary_bytes"]["p50"] <= said["summary_bytes"]["most"] < 2000


def test_closures_are_in_common_within_a_second_at_both_ends_whichever_is_named_first(robots: ModuleType) -> None:
    one = [["a", "b", 0, 10 * SECOND], ["a", "b", 0, 20 * SECOND], ["a", "a", 0, 10 * SECOND]]
    other = [["b", "a", 10.5 * SECOND, 0], ["a", "b", 2 * SECOND, 20 * SECOND], ["a", "c", 0, 20 * SECOND]]
    assert robots.in_common(one, other) == {"common": 1, "of": 2}
    assert robots.in_common(other, one) == {"common": 1, "of": 3}


def test_each_its_own_is_run_once_for_each_number_of_kilobytes(robots: ModuleType) -> None:
    assert list(robots.chosen("packed,each its own", "0,20")) == ["packed", "each its own", "each its own, 20 kB/s"]
