# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from objreg_ros.bridge.node.accounting import Accounting, by_stage, percentiles_ms

STEPS = st.lists(st.tuples(st.sampled_from(("receive", "publish", "overtaken", "malformed")), st.integers(0, 3)))


@given(STEPS)
def test_the_counters_balance_after_every_step(steps: list[tuple[str, int]]) -> None:
    accounting, waiting = Accounting(), Counter[int]()
    for what, stamp_ns in steps:
        if what == "receive":
            accounting.count_frame(stamp_ns)
            waiting[stamp_ns] += 1
        elif waiting[stamp_ns]:
            waiting[stamp_ns] -= 1
            accounting.publish(stamp_ns) if what == "publish" else accounting.drop(stamp_ns, what)
        counters = accounting.balance()
        assert counters.received == counters.published + counters.waiting + sum(counters.dropped.values())
        assert counters.waiting == waiting.total()
    assert counters.received == sum(what == "receive" for what, _ in steps) if steps else True


def test_a_frame_cannot_end_twice() -> None:
    accounting = Accounting()
    accounting.count_frame(5)
    accounting.publish(5)
    with pytest.raises(KeyError, match="no frame of 5 ns waits"):
        accounting.drop(5, "overtaken")
    assert accounting.balance().dropped == {}


def test_a_frame_that_is_handed_on_waits_and_its_keyframe_is_timed_apart() -> None:
    accounting = Accounting()
    for stamp_ns in (5, 6):
        accounting.count_frame(stamp_ns)
    accounting.hand_on(5)
    assert accounting.balance().waiting == 2 and set(accounting.balance().stage_ms) == {"total"}
    accounting.publish(5)
    accounting.publish(6)
    counters = accounting.balance()
    assert (counters.published, counters.waiting, set(counters.stage_ms)) == (2, 0, {"total", "keyframe"})
    with pytest.raises(KeyError, match="no frame of 5 ns waits"):
        accounting.hand_on(5)


def test_two_frames_of_one_stamp_are_two_frames() -> None:
    accounting = Accounting()
    accounting.count_frame(0)
    accounting.count_frame(0)
    accounting.publish(0)
    assert accounting.balance().waiting == 1
    accounting.publish(0)
    assert accounting.balance().published == 2


def test_drops_are_counted_by_reason_and_losses_apart() -> None:
    accounting = Accounting()
    for stamp_ns, reason in enumerate(("overtaken", "malformed_image", "overtaken")):
        accounting.count_frame(stamp_ns)
        accounting.drop(stamp_ns, reason)
    accounting.lose("image", 4)
    counters = accounting.balance()
    assert counters.dropped == {"overtaken": 2, "malformed_image": 1} and counters.lost == {"image": 4}


def test_percentiles_are_those_of_the_durations() -> None:
    assert percentiles_ms([n / 1000 for n in range(101)]) == pytest.approx((50.0, 95.0))


def test_a_stage_is_measured_and_the_way_from_in_to_out_too() -> None:
    accounting = Accounting()
    accounting.count_frame(1)
    with accounting.timed("detect"):
        pass
    accounting.publish(1)
    stages = accounting.balance().stage_ms
    assert set(stages) == {"detect", "total"} and 0 <= stages["detect"][0] <= stages["total"][1] < 10_000.0


def test_no_stage_of_a_frame_takes_longer_than_its_total(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter(float(n) for n in range(1000))
    monkeypatch.setattr("objreg_ros.bridge.node.accounting.time.perf_counter", lambda: next(clock))
    accounting = Accounting()
    for stamp_ns in range(20):
        accounting.count_frame(stamp_ns)
        with accounting.working():
            for _ in range(1 + stamp_ns % 3):
                with accounting.timed("decode"), accounting.timed("check"):
                    pass
            if stamp_ns % 4:
                with accounting.timed("detect"):
                    next(clock)
            if stamp_ns % 5:
                accounting.publish(stamp_ns)
            else:
                accounting.drop(stamp_ns, "refused")
    stages = accounting.balance().stage_ms
    assert set(stages) == {"decode", "detect", "total"} and stages["decode"] == pytest.approx((2000.0, 3000.0))
    assert all(stages[stage][k] <= stages["total"][k] for stage in stages for k in (0, 1))


def test_the_stages_of_a_keyframe_are_part_of_its_time_and_not_of_the_frames() -> None:
    accounting = Accounting()
    accounting.count_frame(5)
    with accounting.working():
        accounting.spend("track", 0.0)
        accounting.hand_on(5)
        accounting.spend("lost", 1.0)  # neither handed on nor published within
    with accounting.working():
        accounting.spend("search", 0.0)
        with accounting.working():
            accounting.publish(5)
    assert set(accounting.balance().stage_ms) == {"track", "total", "search", "keyframe"}


def test_a_stage_that_some_frames_do_without_takes_no_time_of_these() -> None:
    assert by_stage([{"keep": 1.0, "keyframe": 3.0}, {"search": 2.0, "keyframe": 2.0}]) == {
        "keep": [1.0, 0.0],
        "keyframe": [3.0, 2.0],
        "search": [0.0, 2.0],
    }
