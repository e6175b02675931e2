# SPDX-License-Identifier: Apache-2.0
"""Tests of how merged stores are measured beside one registrar, on two robots in one simple place."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest
from merge.stores import ASIDE, AWAY, BESIDE, HERE, frame

from objreg_ros.geometry import inverse
from objreg_tools.truth import Truth

SECOND = 10**9


@pytest.fixture
def benchmark(repository: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """A folder of tests has the same name, so it is found by its path."""
    spec = importlib.util.spec_from_file_location("merge_benchmark", repository / "benchmarks" / "merge.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, spec.name, module)
    spec.loader.exec_module(module)
    return module


def test_merged_stores_are_measured_beside_one_registrar(benchmark: ModuleType, tmp_path: Path) -> None:
    from robots import Robot

    paths = {"east": [(0, HERE), (1, AWAY), (2, ASIDE)], "west": [(30, BESIDE), (32, ASIDE), (33, AWAY)]}
    team = {
        name: Robot(
            [frame(seconds, T, inverse(moments[0][1]), name) for seconds, T in moments],
            Truth((seconds * SECOND, T) for seconds, T in moments),
        )
        for name, moments in paths.items()
    }
    rows = benchmark.building(team, tmp_path)
    assert rows["merged"]["between"] > 0 and rows["merged"]["false"] == 0
    assert rows["merged"]["keyframes"] == rows["one registrar"]["keyframes"] == 6
    assert rows["merged"]["share"] == rows["merged"]["between"] / rows["one registrar"]["between"]
    assert rows["merged"]["map_cm"] < 2.0 and rows["merged"]["keyframes_cm"] < 2.0
    line = benchmark.line("1", "merged", rows["merged"])
    assert line.count("|") == benchmark.HEAD.count("|")
