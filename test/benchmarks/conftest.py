# SPDX-License-Identifier: Apache-2.0
"""The benchmarks are scripts beside each other, no package: their tests find them by the path.

Some have the name of a folder of tests, which is put aside meanwhile.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pytest


@pytest.fixture(autouse=True)
def _scripts_on_the_path(repository: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = repository / "benchmarks"
    monkeypatch.setattr(sys, "path", [str(folder), *sys.path])
    for script in folder.glob("*.py"):
        known = getattr(sys.modules.get(script.stem), "__file__", None)
        if known is not None and Path(known) != script:
            monkeypatch.delitem(sys.modules, script.stem)
