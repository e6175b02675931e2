# SPDX-License-Identifier: Apache-2.0
"""A library that is not installed is named with the extra that brings it."""

from __future__ import annotations

import sys

import pytest

from objreg_ros import extra
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.paper import PaperEngine
from objreg_ros.segmenter.params import SegmenterParams
from objreg_ros.segmenter.segment import Segmenter


def test_a_library_that_is_there_is_loaded() -> None:
    assert extra.load("json", "things", "reading").__name__ == "json"


def test_an_absent_library_is_named_with_its_extra_and_its_purpose() -> None:
    with pytest.raises(ValueError, match=r"^reading: expected no_such_thing, got none; .*objreg_ros\[things\]"):
        extra.load("no_such_thing", "things", "reading")


def test_without_open3d_only_the_founding_method_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "open3d", None)
    Segmenter(SegmenterParams())
    with pytest.raises(ValueError, match=r"method: paper: expected open3d, got none; .*\[paper\]"):
        PaperEngine(RegistrarParams(method="paper"))
    with pytest.raises(ValueError, match=r"preset: paper: expected open3d, got none; .*\[paper\]"):
        Segmenter(SegmenterParams(preset="paper"))
