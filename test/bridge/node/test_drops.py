# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from objreg_ros.bridge.node.drops import Drops


class Clock:
    """A clock that is set by hand."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


def made() -> tuple[Drops, Clock]:
    clock = Clock()
    return Drops(period_s=5.0, clock=clock), clock


def troubled(drops: Drops, clock: Clock, seconds: float) -> list[int]:
    """The seconds, looked at once each from now on, in which there was trouble."""
    start, found = int(clock.now), []
    for second in range(start, start + int(seconds)):
        clock.now = float(second)
        found += [second] if drops.lasting() else []
    return found


def test_an_input_of_which_everything_is_dropped_for_a_period_is_reported_with_the_reasons() -> None:
    drops, clock = made()
    for second in range(7):
        clock.now = float(second)
        drops.drop("frames", "malformed_image", f"got {second}")
        if second < 5:
            assert drops.lasting() == {}
    drops.drop("frames", "unmatched", "no partner")
    trouble = drops.lasting()["frames"]
    assert trouble == "frames: everything was dropped for 6 s, 7 as malformed image, 1 as unmatched (got 6)"


def test_a_burst_is_trouble_for_a_while_and_a_single_drop_is_none() -> None:
    drops, clock = made()
    drops.drop("frames", "late")
    assert troubled(drops, clock, 30) == []
    drops, clock = made()
    for second in (0, 1, 2):
        clock.now = float(second)
        drops.drop("frames", "late")
    assert troubled(drops, clock, 30) == list(range(5, 16))


def test_where_something_gets_through_drops_are_no_trouble() -> None:
    drops, clock = made()
    for second in range(60):
        clock.now = float(second)
        drops.drop("frames", "overtaken")
        if second % 4 == 0:
            drops.let_through("frames")
        assert drops.lasting() == {}


def test_it_ends_two_periods_after_something_got_through() -> None:
    drops, clock = made()
    for second in range(10):
        clock.now = float(second)
        drops.drop("frames", "refused")
        drops.lasting()
    drops.let_through("frames")
    assert troubled(drops, clock, 20) == list(range(9, 19))


def test_what_gets_through_now_and_then_makes_no_flicker() -> None:
    drops, clock = made()
    seen = []
    for second in range(80):
        clock.now = float(second)
        drops.drop("frames", "overtaken")
        if second % 8 == 7:
            drops.let_through("frames")
        seen.append(bool(drops.lasting()))
    assert seen[5:] == [True] * 75


def test_of_several_inputs_each_is_reported_by_itself() -> None:
    drops, clock = made()
    for second in range(7):
        clock.now = float(second)
        drops.drop("odom", "malformed")
        drops.drop("frames", "late")
        drops.let_through("frames")
    drops.let_through("never dropped")
    assert drops.lasting().keys() == {"odom"}
