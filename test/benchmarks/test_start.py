# SPDX-License-Identifier: Apache-2.0
"""Tests of how starts are measured."""

from __future__ import annotations

from pathlib import Path

import pytest


def test_a_process_is_measured_from_its_start_with_the_memory_that_it_has(tmp_path: Path) -> None:
    from start import start

    seconds, little = start("", tmp_path)
    _, much = start("held = bytearray(b'1') * (64 << 20)", tmp_path)
    assert 0.0 < seconds < 60.0 and much > little + 60.0


def test_a_process_that_fails_is_no_figure(tmp_path: Path) -> None:
    from start import start

    with pytest.raises(Exception, match="exit status 1"):
        start("raise SystemExit(1)", tmp_path)
