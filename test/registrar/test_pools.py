# SPDX-License-Identifier: Apache-2.0
"""Threads that try candidates: kept for who is as nice, and apart for who is not."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from objreg_ros.bridge.worker import give_way
from objreg_ros.registrar.pools import Pools


def test_a_nicer_thread_gets_a_pool_of_its_own_and_the_same_one_again() -> None:
    pools, nicer = Pools(2), list[ThreadPoolExecutor]()

    def ask() -> None:
        give_way(5)
        nicer.extend(pools.fitting() for _ in range(2))

    thread = threading.Thread(target=ask)
    thread.start()
    thread.join()
    assert pools.fitting() is pools.fitting() and nicer[0] is nicer[1] and nicer[0] is not pools.fitting()
    pools.shutdown()
    with pytest.raises(RuntimeError, match="shutdown"):
        pools.fitting().submit(print)
