# SPDX-License-Identifier: Apache-2.0
"""How the benchmark of the live graph sorts what it receives."""

from __future__ import annotations

import importlib
import time
from types import SimpleNamespace
from typing import Any

import pytest


@pytest.fixture
def witness(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A witness without a node, by a clock that `at` sets."""
    made = object.__new__(importlib.import_module("latency").Witness)
    made.seen, made.done, made.searched, made.constraints = {}, {}, {}, []
    made._stamp_ns = lambda message: message.stamp
    made.at = lambda now_s: monkeypatch.setattr(time, "monotonic", lambda: now_s)
    return made


def acknowledge(witness: Any, now_s: float, stamp: int, text: str) -> None:
    witness.at(now_s)
    witness._finish(SimpleNamespace(stamp=stamp, frame_id=text))


def test_a_frame_is_through_when_it_is_followed_and_its_search_counts_apart(witness: Any) -> None:
    witness.seen = {1: 0.0, 2: 1.0}
    acknowledge(witness, 0.02, 1, "registrar published")
    acknowledge(witness, 1.04, 2, "registrar followed")
    acknowledge(witness, 1.54, 2, "registrar published")
    assert witness.latency_ms("registrar") == {"frames": 2.0, "p50": 30.0, "p95": 39.0}
    assert witness.search_ms() == {"frames": 1.0, "p50": 500.0, "p95": 500.0}


def test_constraints_are_sorted_by_what_they_waited_for(witness: Any) -> None:
    witness.seen = {stamp: float(stamp) for stamp in range(40)}
    for stamp in (5, 15, 25, 35):  # each completes a keyframe
        acknowledge(witness, stamp + 0.1, stamp, "registrar followed")
        acknowledge(witness, stamp + 0.3, stamp, "registrar published")
    witness.constraints = [(3, 15.3), (14, 15.3), (24, 35.2), (34, 35.2)]
    found = witness.constraint_ms()
    assert [found[kind]["frames"] for kind in ("all", "at_once", "proof", "others")] == [4.0, 2.0, 1.0, 1.0]
    assert found["others"]["p50"] == pytest.approx(11_200.0)
    assert found["at_once"]["p50"] == pytest.approx(1250.0) and found["keyframe"]["p50"] == pytest.approx(1100.0)
