# SPDX-License-Identifier: Apache-2.0
"""What is kept is bounded by time and by bytes, and a file begins where a keyframe does."""

from __future__ import annotations

from itertools import pairwise

from objreg_ros.blackbox.recent import OVERHEAD, Part, Recent, Source, sources_of, times_of

S = 1_000_000_000
DEPTH = Source("/depth", "sensor_msgs/msg/Image", Part.DEPTH)
IMAGE = Source("/image", "sensor_msgs/msg/Image", Part.PICTURE)
ODOM = Source("/odom", "nav_msgs/msg/Odometry", Part.MOTION)
STATIC = Source("/tf_static", "tf2_msgs/msg/TFMessage", Part.MOTION, latched=2)


def filled(seconds: float = 2.0, most_bytes: int = 10**9, frames: int = 100) -> Recent:
    """Ten depth images a second from 100 s, each with an odometry."""
    recent = Recent(seconds, most_bytes)
    for k in range(frames):
        recent.add(DEPTH, b"d%d" % k, 100 * S + k * S // 10, leads=True)
        recent.add(ODOM, b"o%d" % k, None)
    return recent


def depth_stamps(recent: Recent) -> list[float]:
    return [kept.stamp_ns / S for kept in recent.snapshot() if kept.source is DEPTH and kept.stamp_ns is not None]


def test_a_file_holds_the_last_seconds() -> None:
    stamps = depth_stamps(filled(2.0))
    assert (stamps[0], stamps[-1], len(stamps)) == (107.9, 109.9, 21)


def test_twice_the_seconds_are_kept_and_no_more() -> None:
    assert filled(2.0).span_s == 4.0


def test_the_bytes_are_bounded_and_the_oldest_go() -> None:
    recent = Recent(1000.0, 10 * (1000 + OVERHEAD))
    for k in range(50):
        recent.add(DEPTH, bytes(1000), k * S + S, leads=True)
    assert (len(recent), recent.nbytes) == (10, 10 * (1000 + OVERHEAD))
    assert depth_stamps(recent) == [float(k) for k in range(41, 51)]


def test_the_bytes_of_what_waits_for_a_first_stamp_are_bounded_too() -> None:
    recent = Recent(1000.0, 10 * (1000 + OVERHEAD))
    for k in range(50):
        recent.add(IMAGE, bytes([k]) * 1000, None)
    assert sum(len(cdr) + OVERHEAD for _, cdr, _ in recent._early) == 10 * (1000 + OVERHEAD)
    recent.add(ODOM, b"", S, leads=True)
    assert [kept.cdr[0] for kept in recent.snapshot() if kept.source is IMAGE] == list(range(41, 50))


def test_a_file_begins_with_the_last_keyframe_that_began_before_its_seconds() -> None:
    recent = filled(2.0)
    for stamp in (106.5, 107.2, 108.5):
        recent.begin_keyframe(round(stamp * S))
    assert recent.begin_ns() == round(107.2 * S) and depth_stamps(recent)[0] == 107.2


def test_a_keyframe_that_is_kept_no_more_or_is_yet_to_come_is_no_beginning() -> None:
    recent = filled(2.0)
    recent.begin_keyframe(103 * S)
    recent.begin_keyframe(500 * S)
    assert recent.begin_ns() == round(107.9 * S)


def test_a_run_that_is_shorter_than_a_file_is_in_it_from_its_first_message() -> None:
    recent = filled(60.0, frames=30)
    recent.begin_keyframe(round(101.5 * S))
    assert recent.begin_ns() == 100 * S and len(depth_stamps(recent)) == 30


def test_odometry_begins_before_the_pictures_and_colour_a_little() -> None:
    recent = Recent(1.0, 10**9)
    for k in range(40):
        recent.add(IMAGE, b"i", 100 * S + k * S // 10 - S // 100, leads=True)
        recent.add(DEPTH, b"d", 100 * S + k * S // 10, leads=True)
        recent.add(ODOM, b"o", None)
    begin_ns, kept = recent.begin_ns(), recent.snapshot()
    assert begin_ns is not None
    assert min(one.at_ns for one in kept if one.source is ODOM) <= begin_ns - 9 * S // 10
    assert min(one.stamp_ns or 0 for one in kept if one.source is DEPTH) == begin_ns
    assert begin_ns - S // 5 <= min(one.stamp_ns or 0 for one in kept if one.source is IMAGE) < begin_ns


def test_what_is_latched_is_in_every_file_however_old_it_is() -> None:
    recent = Recent(1.0, 10**9)
    for cdr in (b"a", b"b", b"b", b"c"):
        recent.add(STATIC, cdr, None)  # before any stamp
    for k in range(100):
        recent.add(DEPTH, b"d", 100 * S + k * S // 10, leads=True)
    kept = recent.snapshot()
    assert [one.cdr for one in kept[:2]] == [b"b", b"c"] and kept[0].at_ns == kept[2].at_ns
    assert STATIC in sources_of(kept)


def test_what_is_latched_and_came_in_its_seconds_is_in_it_once() -> None:
    recent = filled(2.0)
    recent.add(STATIC, b"new", None)
    assert [one.cdr for one in recent.snapshot() if one.source is STATIC] == [b"new"]


def test_a_clock_that_goes_back_forgets_all_but_what_is_latched() -> None:
    recent = filled(2.0)
    recent.add(STATIC, b"s", None)
    recent.begin_keyframe(108 * S)
    recent.add(DEPTH, b"again", 50 * S, leads=True)
    assert recent.jumps == 1 and depth_stamps(recent) == [50.0] and recent.begin_ns() == 50 * S
    assert [one.cdr for one in recent.snapshot()] == [b"s", b"again"]


def test_a_late_message_is_no_jump() -> None:
    recent = filled(2.0)
    recent.add(DEPTH, b"late", 109 * S + S // 2, leads=True)
    assert recent.jumps == 0 and recent.clock_ns == round(109.9 * S)


def test_nothing_is_kept_before_the_first_stamp_and_there_is_no_file_of_nothing() -> None:
    recent = Recent(1.0, 1000)
    recent.add(ODOM, b"o", None)
    assert (len(recent), recent.snapshot(), recent.begin_ns(), recent.span_s) == (0, [], None, 0.0)


def test_times_rise_with_every_message() -> None:
    times = times_of(filled(2.0).snapshot())
    assert all(a < b for a, b in pairwise(times))
