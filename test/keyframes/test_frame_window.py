# SPDX-License-Identifier: Apache-2.0
"""What passes between tracking and the search."""

from __future__ import annotations

import threading

from objreg_ros.keyframes.frame_window import SessionNumbers


def test_threads_that_share_numbers_get_none_twice() -> None:
    numbers, taken = SessionNumbers(7), list[int]()
    threads = [
        threading.Thread(target=lambda: taken.extend(numbers.next_number() for _ in range(500))) for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(taken) == list(range(7, 2007)) and numbers.next == 2007
