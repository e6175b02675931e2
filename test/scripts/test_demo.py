# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import shutil
import subprocess
from pathlib import Path


def test_paths_are_from_where_the_demo_is_called(repository: Path, tmp_path: Path) -> None:
    checkout, elsewhere = tmp_path / "check out", tmp_path / "elsewhere"
    for folder in (checkout / "scripts", checkout / ".venv/bin", elsewhere):
        folder.mkdir(parents=True)
    shutil.copy(repository / "scripts/demo", checkout / "scripts/demo")
    for name, line in {"scripts/bootstrap": "exit 0", ".venv/bin/objreg": 'echo "$PWD $@"'}.items():
        (checkout / name).write_text(f"#!/bin/bash\n{line}\n")
        (checkout / name).chmod(0o755)
    said = subprocess.run(["../check out/scripts/demo", "my_bag"], cwd=elsewhere, capture_output=True, text=True)
    assert said.stdout == f"{elsewhere} demo my_bag\n", said.stderr
