# SPDX-License-Identifier: Apache-2.0
"""A second thread for half of a frame's work: the kernels let go of the interpreter's lock."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, Generic, TypeVar

T = TypeVar("T")


class Started(Generic[T]):
    """Work that a second thread has been given."""

    def __init__(self, thread: ThreadPoolExecutor, work: Callable[..., T], *inputs: Any) -> None:
        self._work, self._inputs = work, inputs
        self._future: Future[T] = thread.submit(work, *inputs)

    def result(self) -> T:
        """What the work returns; done here if the thread has not begun, as where all cores are busy."""
        return self._work(*self._inputs) if self._future.cancel() else self._future.result()


class SecondThread:
    """One thread beside the caller's."""

    def __init__(self, name: str) -> None:
        self._thread = ThreadPoolExecutor(1, name)

    def start(self, work: Callable[..., T], *inputs: Any) -> Started[T]:
        """Begin ``work(*inputs)``."""
        return Started(self._thread, work, *inputs)
