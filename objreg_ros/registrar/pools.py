# SPDX-License-Identifier: Apache-2.0
"""The threads that try candidate keyframes."""

from __future__ import annotations

import os
import sys
import threading
from concurrent.futures import ThreadPoolExecutor


class Pools:
    """Pools of so many ``threads``, one for each niceness: a thread may not take it back."""

    def __init__(self, threads: int) -> None:
        self._threads, self._pools = threads, dict[int, ThreadPoolExecutor]()

    def fitting(self) -> ThreadPoolExecutor:
        """That of the niceness of the thread that asks; kept, since each new one costs memory."""
        nice = os.getpriority(os.PRIO_PROCESS, threading.get_native_id()) if sys.platform == "linux" else 0
        if nice not in self._pools:
            self._pools[nice] = ThreadPoolExecutor(self._threads, "register")
        return self._pools[nice]

    def shutdown(self) -> None:
        """Wait for what they are at, and end them."""
        for pool in self._pools.values():
            pool.shutdown()
