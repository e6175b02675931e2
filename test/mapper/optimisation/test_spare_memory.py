# SPDX-License-Identifier: Apache-2.0
"""What is freed between blocks that stay goes back to the system."""

from __future__ import annotations

import ctypes
from pathlib import Path

import numpy as np
import pytest

from objreg_mapper.optimisation.spare_memory import give_back

BLOCKS, NUMBERS = 2000, 4000  # of 32 kB, which come from the heap


def resident_mb() -> float:
    """What of this process is in memory."""
    fields = Path("/proc/self/status").read_text().split("VmRSS:")[1].split()
    return int(fields[0]) / 1e3


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "malloc_trim"), reason="not the GNU C library")
def test_pages_that_are_free_between_others_are_given_back() -> None:
    blocks = [np.ones(NUMBERS) for _ in range(BLOCKS)]
    stays, before = blocks[::2], resident_mb()
    del blocks
    give_back()
    assert resident_mb() < before - 0.25 * BLOCKS * NUMBERS * 8 / 1e6
    assert all(block.all() for block in stays)


def test_without_such_a_library_nothing_happens(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ctypes, "CDLL", lambda name: object())
    give_back()
