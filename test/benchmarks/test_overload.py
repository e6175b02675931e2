# SPDX-License-Identifier: Apache-2.0
"""What the benchmark of an overloaded graph plays, and how it reads the growth of memory."""

from __future__ import annotations

import importlib
import struct
from types import ModuleType

import pytest

from objreg_tools.recording.rosbag.messages import header_stamp_ns

SECOND = 1_000_000_000


@pytest.fixture
def overload() -> ModuleType:
    return importlib.import_module("overload")


def cdr(stamp_ns: int) -> bytes:
    return b"\x00\x01\x00\x00" + struct.pack("<iI", *divmod(stamp_ns, SECOND)) + b"the rest"


def test_a_recording_is_played_over_and_over_with_stamps_that_go_on(overload: ModuleType) -> None:
    pytest.importorskip("rclpy", reason="its items are those of the player, which needs ROS 2")
    messages = [("image", 5 * SECOND + k * SECOND // 2, cdr(5 * SECOND + k * SECOND // 2)) for k in range(4)]
    items = list(overload.endless(messages, seconds=7.0))
    stamps = [header_stamp_ns(item.cdr) for item in items]
    assert len(items) > 8 and stamps == sorted(set(stamps)) and stamps[-1] <= 12 * SECOND
    assert all(
        item.cdr.endswith(b"the rest") and item.stamp_ns == stamp for item, stamp in zip(items, stamps, strict=True)
    )


def test_growth_is_that_after_the_warm_up(overload: ModuleType) -> None:
    samples = [(float(k), 0.0, 1000.0 * min(k, 10) + k) for k in range(100)]
    assert overload.slope_mb_per_hour(samples, 10.0) == pytest.approx(3600.0)


def test_the_counters_of_a_node_account_for_every_frame_or_say_how_many_not(overload: ModuleType) -> None:
    counters = {"received": "10", "published": "6", "waiting": "1", "dropped: late": "2", "dropped: unmatched": "1"}
    assert overload.unaccounted(counters) == 0
    assert overload.unaccounted(counters | {"received": "12"}) == 2
