# SPDX-License-Identifier: Apache-2.0
"""Recordings that scripts of a folder write, one for each CASE of their docstrings, run offline.

A script takes its case from the environment: CASE, DATA (a TUM RGB-D folder), OUT (what it writes) and STEP (every
n-th frame).
"""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from stream_cases import Row, asked_of, detector_of, examined

SCRIPTS = ("plain.py", "cameras.py")
CASE_LINE = re.compile(r"^([a-z][a-z0-9_]*) +\S", re.MULTILINE)
PATIENCE_S = 300


@dataclass(frozen=True)
class Written:
    """A case of a script, and what it is made of and run with."""

    script: Path
    case: str
    data: Path
    step: int
    model: str
    threshold: float


def cases_of(script: Path) -> list[str]:
    """The names at the beginnings of the lines of a script's docstring, behind its first paragraph."""
    docstring = ast.get_docstring(ast.parse(script.read_text()), clean=False) or ""
    return CASE_LINE.findall(docstring.partition("\n\n")[2])


def run_generator(of: Written) -> Row:
    """What became of the recording that a script writes; ``refused`` says why where there is none, or none was run."""
    start = time.perf_counter()
    row: Row = {"case": f"{of.script.stem}:{of.case}"}
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / of.case
        try:
            _write(of, out)
            with asked_of(of.model, of.threshold).opened(out) as opened:
                row |= examined(opened, detector_of(of.model, of.threshold))
        except (ValueError, OSError) as error:
            row |= {"constraints": 0, "false": 0, "findings": [], "refused": str(error)}
    return {**row, "seconds": round(time.perf_counter() - start, 2)}


def _write(of: Written, out: Path) -> None:
    """Run the script; OSError with what it said last where it fails."""
    variables = {"CASE": of.case, "DATA": str(of.data), "OUT": str(out), "STEP": str(of.step)}
    command = [sys.executable, "-B", of.script.name]
    ended = subprocess.run(
        command,
        cwd=of.script.parent,
        env={**os.environ, **variables},
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
    )
    if ended.returncode:
        said = (ended.stderr.strip().splitlines() or ["nothing"])[-1]
        raise OSError(f"{of.script.name} {of.case}: expected a recording, got exit {ended.returncode}: {said}")
