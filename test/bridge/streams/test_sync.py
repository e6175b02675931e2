# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from objreg_ros.bridge.streams.clock_monitor import AHEAD_NS
from objreg_ros.bridge.streams.sync import (
    ENCLOSING,
    JUMP_NS,
    MOST_BYTES,
    PATIENCE_NS,
    SILENCE_NS,
    Drop,
    Match,
    Need,
    Stream,
    Synchroniser,
)

EXACT = (Stream("image"), Stream("depth"))


def accounts_hold(sync: Synchroniser) -> bool:
    return all(q.received == q.matched + q.waiting + q.dropped.total() for q in sync.queues.values())


def pairs(matches: list[Match], *names: str) -> list[tuple]:
    return [tuple(match[name] for name in names) for match in matches]


def test_equal_stamps_match_in_any_order_of_arrival() -> None:
    sync = Synchroniser(EXACT)
    assert sync.add_item("depth", 5, "d5") == [] and sync.add_item("depth", 6, "d6") == []
    assert pairs(sync.add_item("image", 5, "i5"), "image", "depth") == [("i5", "d5")]
    assert pairs(sync.add_item("image", 6, "i6"), "image", "depth") == [("i6", "d6")]
    assert accounts_hold(sync)


def test_an_image_whose_depth_was_lost_is_dropped_and_counted() -> None:
    sync = Synchroniser(EXACT)
    sync.add_item("image", 1, "i1")
    sync.add_item("image", 2, "i2")
    assert pairs(sync.add_item("depth", 2, "d2"), "image") == [("i2",)]
    assert sync.queues["image"].dropped == {"unmatched": 1} and accounts_hold(sync)


def test_the_nearest_within_the_slop_is_taken_once_it_is_known() -> None:
    sync = Synchroniser((Stream("image"), Stream("depth", slop_ns=10)))
    sync.add_item("depth", 92, "far")
    sync.add_item("depth", 97, "near")
    assert sync.add_item("image", 100, "i") == []  # one at 101 may still come
    assert pairs(sync.add_item("depth", 105, "later"), "depth") == [("near",)]
    assert sync.queues["depth"].dropped == {"unmatched": 1} and sync.queues["depth"].waiting == 1
    assert accounts_hold(sync)


def test_what_was_left_out_is_matched_like_the_rest_and_says_so() -> None:
    sync = Synchroniser((Stream("image"), Stream("boxes", slop_ns=10)))
    found = []
    for stamp_ns, item in ((100, "b"), (133, Drop.SURPLUS), (166, Drop.SURPLUS), (200, "b")):
        found += sync.add_item("boxes", stamp_ns, item)
        found += sync.add_item("image", stamp_ns + 5, "i")
    found += sync.flush()
    assert [(match.stamp_ns, match.is_surplus) for match in found] == [
        (105, False),
        (138, True),
        (171, True),
        (205, False),
    ]
    assert accounts_hold(sync) and not any(queue.dropped for queue in sync.queues.values())


def test_nothing_within_the_slop_is_no_match() -> None:
    sync = Synchroniser((Stream("image"), Stream("depth", slop_ns=10)))
    sync.add_item("image", 100, "i")
    assert sync.add_item("depth", 111, "d") == []
    assert sync.queues["image"].dropped == {"unmatched": 1} and accounts_hold(sync)


def test_a_required_item_serves_the_one_match_of_its_nearest() -> None:
    sync = Synchroniser((Stream("image"), Stream("depth", slop_ns=10)))
    sync.add_item("image", 100, "i")
    sync.add_item("image", 104, "j")
    assert pairs(sync.add_item("depth", 104, "d"), "image") == [("j",)]
    assert sync.queues["image"].dropped == {"unmatched": 1}
    assert sync.flush() == [] and accounts_hold(sync)


def test_one_that_has_a_nearer_partner_leaves_the_other_to_whom_it_suits() -> None:
    sync = Synchroniser((Stream("image"), Stream("depth", slop_ns=10)))
    sync.add_item("image", 100, "i")
    sync.add_item("image", 112, "j")
    sync.add_item("depth", 107, "d")  # nearer to j, which has a nearer one still
    assert pairs(sync.add_item("depth", 114, "e"), "image", "depth") == [("i", "d"), ("j", "e")]
    assert accounts_hold(sync)


@pytest.mark.parametrize(
    ("reference_ms", "partner_ms", "offset_ms", "expected_ms"),
    [(1000 / 60, 1000 / 30, 18.0, 1.4), (1000 / 30, 1000 / 15, 20.0, 13.4), (1000 / 30, 1000 / 30, 5.0, 5.1)],
)
def test_every_partner_meets_its_nearest_whichever_stream_is_faster(
    reference_ms: float, partner_ms: float, offset_ms: float, expected_ms: float
) -> None:
    sync = Synchroniser((Stream("depth"), Stream("image", slop_ns=20_000_000)))
    stamps = [(round(k * reference_ms * 1e6), "depth") for k in range(60)]
    stamps += [(round((k * partner_ms + offset_ms) * 1e6), "image") for k in range(20)]
    matches = [match for stamp_ns, name in sorted(stamps) for match in sync.add_item(name, stamp_ns, stamp_ns)]
    assert len(matches) >= 19
    assert max(abs(match["depth"] - match["image"]) for match in matches[1:]) < expected_ms * 1e6  # the rate is known


def test_a_latched_value_serves_every_match_and_is_waited_for() -> None:
    sync = Synchroniser((Stream("image"), Stream("info", Need.LATCHED)))
    assert sync.add_item("image", 1, "i1") == []
    assert pairs(sync.add_item("info", 0, "K"), "image", "info") == [("i1", "K")]
    assert pairs(sync.add_item("image", 2, "i2"), "info") == [("K",)]
    assert accounts_hold(sync)


def test_an_optional_stream_that_never_spoke_is_not_waited_for() -> None:
    sync = Synchroniser((Stream("image"), Stream("odom", Need.OPTIONAL, slop_ns=10)))
    assert pairs(sync.add_item("image", 1, "i"), "odom") == [(None,)]


def test_an_expected_stream_is_waited_for_from_the_start() -> None:
    sync = Synchroniser((Stream("image"), Stream("odom", Need.OPTIONAL, slop_ns=10, expected=True)))
    assert sync.add_item("image", 100, "i") == []
    assert pairs(sync.add_item("odom", 101, "o"), "image", "odom") == [("i", "o")]
    assert accounts_hold(sync)


def test_an_optional_stream_that_has_spoken_is_waited_for_and_reused() -> None:
    sync = Synchroniser((Stream("image"), Stream("odom", Need.OPTIONAL, slop_ns=10)))
    sync.add_item("odom", 0, "o0")
    assert sync.add_item("image", 4, "i4") == [] and sync.add_item("image", 5, "i5") == []
    assert pairs(sync.add_item("odom", 20, "o20"), "image", "odom") == [("i4", "o0"), ("i5", "o0")]
    assert sync.queues["odom"].matched == 1 and accounts_hold(sync)


def test_an_enclosing_stream_gives_what_is_on_either_side_of_a_time() -> None:
    sync = Synchroniser((Stream("image"), Stream("odom", Need.OPTIONAL, slop_ns=10, enclosing=True)))
    found = []
    for stamp in (0, 30, 60, 200, 215):
        found += sync.add_item("odom", stamp, f"o{stamp}")
        for image in {30: (30, 45), 60: (70,), 200: (130, 205)}.get(stamp, ()):
            found += sync.add_item("image", image, image)
    expected = [(30, ("o30",)), (45, ("o30", "o60")), (70, ("o60",)), (130, None), (205, ("o200", "o215"))]
    assert pairs(found, "image", "odom") == expected  # o60 and o200 are too far apart to enclose 70 or 130
    assert accounts_hold(sync)


def test_what_encloses_one_time_encloses_the_next_one_too() -> None:
    sync = Synchroniser((Stream("image"), Stream("odom", Need.OPTIONAL, slop_ns=10, enclosing=True)))
    sync.add_item("odom", 30, "before")
    for image in (41, 44, 49):
        sync.add_item("image", image, image)
    found = sync.add_item("odom", 60, "after")
    assert pairs(found, "image", "odom") == [(image, ("before", "after")) for image in (41, 44, 49)]
    assert sync.queues["odom"].matched == 2 and accounts_hold(sync)


@pytest.mark.parametrize(("gap_ns", "found"), [(10 * ENCLOSING, ("before", "after")), (10 * ENCLOSING + 1, None)])
def test_two_enclose_a_time_up_to_a_number_of_slops(gap_ns: int, found: tuple[str, str] | None) -> None:
    assert 20 * ENCLOSING > 100  # ms: with a slop of 20, odometry of 10 Hz encloses what comes between
    sync = Synchroniser((Stream("image"), Stream("odom", Need.OPTIONAL, slop_ns=10, enclosing=True)))
    sync.add_item("odom", 0, "before")
    sync.add_item("image", 30, "i")
    assert pairs(sync.add_item("odom", gap_ns, "after"), "odom") == [(found,)]


@pytest.mark.parametrize("need", [Need.REQUIRED, Need.LATCHED])
def test_an_enclosing_stream_that_is_not_optional_is_refused(need: Need) -> None:
    with pytest.raises(ValueError, match="odom: expected an enclosing stream to be optional"):
        Stream("odom", need, enclosing=True)


def test_an_optional_stream_that_died_is_given_up_when_the_queue_is_full() -> None:
    sync = Synchroniser((Stream("image", depth=2), Stream("odom", Need.OPTIONAL, slop_ns=10)))
    sync.add_item("odom", 0, "o")
    image = SimpleNamespace(data=range(MOST_BYTES // 2))
    found = [match for t in (100, 200, 300, 400) for match in sync.add_item("image", t, image)]
    assert [match.stamp_ns for match in found] == [100, 200] and accounts_hold(sync)
    assert pairs(found, "odom") == [(None,), (None,)]


def test_an_optional_stream_that_has_been_silent_for_long_is_not_waited_for() -> None:
    sync = Synchroniser((Stream("image"), Stream("odom", Need.OPTIONAL, slop_ns=10)))
    sync.add_item("odom", 5, "o")
    assert sync.add_item("image", 6 + SILENCE_NS // 2, "a") == []
    late_ns = 6 + SILENCE_NS
    assert pairs(sync.add_item("image", late_ns, "b"), "image", "odom") == [("a", None), ("b", None)]
    assert pairs(sync.add_item("image", late_ns + 1, "c"), "image", "odom") == [("c", None)]


def test_a_full_queue_drops_its_oldest_with_a_reason() -> None:
    sync = Synchroniser((Stream("image", depth=2), Stream("depth", depth=3)))
    for t in range(0, 5 * PATIENCE_NS, PATIENCE_NS):
        sync.add_item("image", t, t)
    assert sync.queues["image"].dropped == {"queue_full": 3} and sync.queues["image"].waiting == 2
    other = Synchroniser((Stream("image", depth=2), Stream("depth", depth=3)))
    for t in range(0, 5 * PATIENCE_NS, PATIENCE_NS):
        other.add_item("depth", t, t)
    assert other.queues["depth"].dropped == {"queue_full": 2} and accounts_hold(sync) and accounts_hold(other)


def test_what_nothing_waited_for_was_not_matched_rather_than_crowded_out() -> None:
    sync = Synchroniser((Stream("image"), Stream("odom", Need.OPTIONAL, depth=3)))
    for t in range(0, 5 * PATIENCE_NS, PATIENCE_NS):
        sync.add_item("odom", t, t)
    assert sync.queues["odom"].dropped == {"unmatched": 2} and accounts_hold(sync)


def test_what_comes_fast_waits_long_enough_for_a_slow_partner() -> None:
    sync = Synchroniser((Stream("depth"), Stream("detections", slop_ns=10)))
    step_ns, slow_ns = PATIENCE_NS // 60, PATIENCE_NS // 3
    found = []
    for t in range(0, 10 * slow_ns, step_ns):
        found += sync.add_item("depth", t, t)
        if t % slow_ns < step_ns and t >= slow_ns:  # about a picture seen one slow look before
            seen = (t - slow_ns) // step_ns * step_ns
            found += sync.add_item("detections", seen, seen)
    assert len(found) >= 8 and accounts_hold(sync)
    assert sync.queues["depth"].waiting * step_ns <= PATIENCE_NS + step_ns


def test_large_items_are_dropped_however_short_they_have_waited() -> None:
    sync = Synchroniser((Stream("cloud", depth=3), Stream("detections")))
    for t in range(20):
        sync.add_item("cloud", t, SimpleNamespace(data=range(MOST_BYTES // 5)))
    assert sync.queues["cloud"].waiting == 5 and sync.queues["cloud"].dropped == {"queue_full": 15}


def test_one_that_comes_late_is_passed_over_and_nothing_that_waits_is_lost() -> None:
    sync = Synchroniser((Stream("image"), Stream("depth"), Stream("odom", Need.OPTIONAL, slop_ns=10)))
    sync.add_item("odom", JUMP_NS, "o")
    sync.add_item("image", JUMP_NS + 5, "i")
    sync.add_item("odom", JUMP_NS - 3, "late")
    sync.add_item("image", JUMP_NS + 1, "late")
    sync.add_item("depth", JUMP_NS + 5, "d")
    assert pairs(sync.add_item("odom", JUMP_NS + 20, "p"), "image", "depth", "odom") == [("i", "d", "o")]
    assert sync.queues["odom"].dropped == sync.queues["image"].dropped == {"late": 1} and accounts_hold(sync)


def test_what_a_match_lacks_is_named() -> None:
    streams = [Stream("image"), Stream("depth", slop_ns=10), Stream("odom", Need.OPTIONAL), Stream("k", Need.LATCHED)]
    sync = Synchroniser(streams)
    assert [stream.name for stream in sync.lacking(100)] == ["depth", "k"]
    sync.add_item("depth", 109, "d")
    sync.add_item("k", 0, "camera")
    assert sync.lacking(100) == [] and [stream.name for stream in sync.lacking(98)] == ["depth"]


def test_a_looped_recording_matches_as_well_the_second_time() -> None:
    sync = Synchroniser(EXACT)
    stamps = range(0, 50 * JUMP_NS, JUMP_NS)
    passes = [sum(len(sync.add_item(name, t, t)) for t in stamps for name in ("image", "depth")) for _ in range(3)]
    assert passes == [50, 50, 50] and accounts_hold(sync)


def test_a_jump_back_drops_what_waits_in_the_future() -> None:
    sync = Synchroniser(EXACT)
    for stamp, what in ((10 + JUMP_NS, "old"), (10, "new"), (20, "newer")):
        sync.add_item("image", stamp, what)
    assert sync.queues["image"].dropped == {"time_jump": 1}
    assert pairs(sync.add_item("depth", 10, "d"), "image") == [("new",)] and accounts_hold(sync)


def test_one_stamp_that_is_far_from_its_neighbours_is_left_out_and_nothing_else() -> None:
    for odd in (0, 3600 * JUMP_NS):
        sync, stamps = Synchroniser(EXACT), [5 * JUMP_NS, 5 * JUMP_NS + 1, odd, 5 * JUMP_NS + 2, 5 * JUMP_NS + 3]
        found = [
            match.stamp_ns for stamp in stamps for name in sync.queues for match in sync.add_item(name, stamp, stamp)
        ]
        assert found == [stamp for stamp in stamps if stamp != odd]
        assert all(q.dropped == {"odd_stamp": 1} for q in sync.queues.values()) and accounts_hold(sync)


def test_a_jump_back_of_one_item_is_believed_after_a_while() -> None:
    sync = Synchroniser(EXACT)
    for name in ("image", "depth"):
        sync.add_item(name, 5 * JUMP_NS, "old")
    assert sync.add_item("image", 1, "i") == sync.add_item("depth", 1, "d") == sync.believe(JUMP_NS) == []
    assert pairs(sync.believe(JUMP_NS), "image", "depth") == [("i", "d")] and accounts_hold(sync)


def test_what_is_believed_together_is_matched_together() -> None:
    sync = Synchroniser((*EXACT, Stream("odom", Need.OPTIONAL)))
    for stamp in (5 * JUMP_NS, 1):
        for name in sync.queues:
            sync.add_item(name, stamp, name)
    assert sync.believe(JUMP_NS) == [] and [match["odom"] for match in sync.believe(JUMP_NS)] == ["odom"]


@pytest.mark.parametrize("looks", [2, 3, 4])
def test_a_recording_of_a_few_looks_that_are_minutes_apart_is_matched_to_its_end(looks: int) -> None:
    sync = Synchroniser(EXACT)
    found = [
        match for k in range(looks) for name in ("image", "depth") for match in sync.add_item(name, k * AHEAD_NS, k)
    ]
    found += sync.flush()
    assert [match["image"] for match in found] == list(range(looks)) and accounts_hold(sync)


def test_a_stream_that_follows_anothers_jump_back_loses_nothing_in_silence() -> None:
    sync = Synchroniser((Stream("image"), Stream("depth"), Stream("odom", Need.OPTIONAL)))
    for name, stamp in (("depth", 1), ("odom", 1 + JUMP_NS), ("odom", 1), ("odom", 1), ("image", 0)):
        assert sync.add_item(name, stamp, stamp) == []
    assert pairs(sync.add_item("depth", 0, "d0"), "depth") == [("d0",)]
    assert sync.queues["depth"].dropped == {"time_jump": 1} and accounts_hold(sync)


def test_one_frame_played_again_and_again_matches_each_time() -> None:
    sync = Synchroniser(EXACT)
    assert sum(len(sync.add_item(name, 7, 7)) for _ in range(4) for name in ("image", "depth")) == 4


def test_what_waits_for_nothing_but_an_optional_stream_need_wait_no_longer() -> None:
    sync = Synchroniser((*EXACT, Stream("odom", Need.OPTIONAL, slop_ns=2, enclosing=True)))
    for name, stamp in (("odom", 0), ("odom", 7), ("image", 9), ("depth", 9), ("image", 20)):
        assert sync.add_item(name, stamp, f"{name}{stamp}") == []
    (match,) = sync.wait_no_longer()
    assert (match["image"], match["depth"], match["odom"]) == ("image9", "depth9", ("odom7",))
    assert sync.wait_no_longer() == [] and accounts_hold(sync)
    assert sync.queues["image"].waiting == 1 and sync.received == 5  # its depth may come yet
    assert sync.add_item("depth", 20, "depth20") == []
    assert [match["odom"] for match in sync.wait_no_longer()] == [None] and accounts_hold(sync)


def test_flush_gives_what_is_still_possible() -> None:
    sync = Synchroniser((Stream("image"), Stream("depth", slop_ns=10)))
    sync.add_item("depth", 97, "d")
    sync.add_item("image", 100, "i")
    sync.add_item("image", 200, "alone")
    assert pairs(sync.flush(), "image", "depth") == [("i", "d")]
    assert sync.queues["image"].dropped == {"unmatched": 1} and accounts_hold(sync)


def test_a_reference_that_is_not_required_is_refused() -> None:
    with pytest.raises(ValueError, match="required stream first"):
        Synchroniser((Stream("info", Need.LATCHED),))


NAMES = ("image", "depth", "odom", "info")
ARRIVALS = st.lists(st.tuples(st.sampled_from(NAMES), st.integers(0, 30)), max_size=80)
STEP_NS = JUMP_NS // 3  # some that go back are late, some have begun anew


@given(ARRIVALS, st.integers(0, 5), st.integers(1, 4))
def test_nothing_is_lost_in_silence_whatever_comes(arrivals: list[tuple[str, int]], slop: int, depth: int) -> None:
    sync = Synchroniser(
        (
            Stream("image", depth=depth),
            Stream("depth", slop_ns=slop * STEP_NS, depth=depth),
            Stream("odom", Need.OPTIONAL, slop_ns=slop * STEP_NS, depth=depth),
            Stream("info", Need.LATCHED),
        )
    )
    found, queues = [], sync.queues.values()
    for name, stamp in arrivals:
        found += sync.add_item(name, stamp * STEP_NS, stamp)
        assert accounts_hold(sync)
        assert all(len(q.items) <= depth or q.items[-1].stamp_ns - q.items[0].stamp_ns <= PATIENCE_NS for q in queues)
    found += sync.flush()
    assert accounts_hold(sync)
    assert all(abs(match["depth"] - match["image"]) <= slop for match in found)
    assert sync.queues["image"].matched == sync.queues["depth"].matched == len(found)


def test_every_drop_is_reported_with_its_stream_stamp_and_reason() -> None:
    reported: list[tuple[str, int, str]] = []
    sync = Synchroniser(EXACT, on_drop=lambda name, stamp_ns, why: reported.append((name, stamp_ns, why)))
    for name, stamp in (("image", 10), ("image", JUMP_NS), ("depth", JUMP_NS), ("depth", JUMP_NS + 30)):
        sync.add_item(name, stamp, stamp)
    for stamp in (0, 1):
        sync.add_item("image", stamp, stamp)
    assert reported == [("image", 10, "unmatched"), ("depth", JUMP_NS + 30, "time_jump")]
    assert sum(q.dropped.total() for q in sync.queues.values()) == len(reported)
