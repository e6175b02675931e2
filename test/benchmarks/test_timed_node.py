# SPDX-License-Identifier: Apache-2.0
"""How a node's milliseconds are sorted by stage."""

from __future__ import annotations

import importlib
import time
from itertools import count

import pytest


def test_a_stage_within_another_has_its_time_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    stages = importlib.import_module("timed_node").Stages()
    ticks = count()
    monkeypatch.setattr(time, "perf_counter", lambda: float(next(ticks)))
    monkeypatch.setattr(time, "thread_time", lambda: 0.0)
    inner = stages.wrapped("inner", lambda: "found")
    with stages.timed("outer"):
        assert inner() == "found"
    assert stages.runs == {"inner": [(1.0, 0.0)], "outer": [(2.0, 0.0)]}


def test_what_a_process_used_counts_from_its_first_frame_on(monkeypatch: pytest.MonkeyPatch) -> None:
    stages = importlib.import_module("timed_node").Stages()
    for begins, now_s in ((True, 10.0), (True, 11.0), (False, 14.0)):
        monkeypatch.setattr(time, "monotonic", lambda now_s=now_s: now_s)
        monkeypatch.setattr(time, "process_time", lambda now_s=now_s: 0.5 * now_s)
        if begins:
            stages.begin()
    figures = stages.figures()
    assert (figures["seconds"], figures["processor_seconds"]) == (4.0, 2.0)
