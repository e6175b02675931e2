# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import threading

from objreg_ros.bridge.streams.frame_order import FrameOrder


def test_a_frame_that_is_put_off_is_due_at_once_where_none_is_at_work() -> None:
    due: list[int] = []
    turns = FrameOrder(lambda stamp_ns, frame_id: due.append(stamp_ns))
    turns.put_off(1, "eye")
    turns.begin_frame(2)
    turns.end_frame(2)
    turns.put_off(3, "eye")
    assert due == [1, 3]


def test_it_waits_for_every_frame_before_it_and_for_none_behind_it() -> None:
    due: list[int] = []
    turns = FrameOrder(lambda stamp_ns, frame_id: due.append(stamp_ns))
    turns.begin_frame(1)
    turns.put_off(2, "eye")
    turns.begin_frame(3)
    turns.put_off(4, "eye")
    turns.end_frame(3)  # overtaken, while 1 is at work
    assert due == []
    turns.begin_frame(5)
    turns.end_frame(1)
    assert due == [2, 4]


def test_two_frames_of_one_stamp_end_one_by_one() -> None:
    due: list[int] = []
    turns = FrameOrder(lambda stamp_ns, frame_id: due.append(stamp_ns))
    turns.begin_frame(1)
    turns.put_off(2, "eye")
    turns.begin_frame(1)
    turns.put_off(3, "eye")
    turns.end_frame(1)
    assert due == [2]
    turns.end_frame(1)
    assert due == [2, 3]


def test_threads_keep_the_order() -> None:
    due: list[int] = []
    turns = FrameOrder(lambda stamp_ns, frame_id: due.append(stamp_ns))
    for stamp in range(0, 400, 2):
        turns.begin_frame(stamp)
        turns.put_off(stamp + 1, "eye")
    halves = [range(0, 200, 2), range(398, 199, -2)]
    threads = [threading.Thread(target=lambda half=half: [turns.end_frame(stamp) for stamp in half]) for half in halves]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert due == list(range(1, 400, 2))
