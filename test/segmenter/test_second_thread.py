# SPDX-License-Identifier: Apache-2.0
"""Work on a second thread."""

from __future__ import annotations

import threading

import pytest

from objreg_ros.segmenter.second_thread import SecondThread


def test_work_is_done_beside_the_caller() -> None:
    thread, here = SecondThread("beside"), threading.get_ident()
    begun = threading.Event()

    def work() -> int:
        begun.set()
        return threading.get_ident()

    started = thread.start(work)
    assert begun.wait(60.0)
    assert started.result() != here


def test_work_that_has_not_begun_is_done_by_the_caller() -> None:
    thread, release = SecondThread("beside"), threading.Event()
    busy = thread.start(release.wait, 10.0)
    waiting = thread.start(threading.get_ident)
    assert waiting.result() == threading.get_ident()
    release.set()
    assert busy.result()


def test_an_error_of_the_work_reaches_the_caller() -> None:
    with pytest.raises(ZeroDivisionError):
        SecondThread("beside").start(divmod, 1, 0).result()
