# SPDX-License-Identifier: Apache-2.0
"""The benchmarks are scripts beside each other, no package: their tests find them by the path."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest


@pytest.fixture(autouse=True)
def _scripts_on_the_path(repository: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", [*sys.path, str(repository / "benchmarks")])
