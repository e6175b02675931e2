# SPDX-License-Identifier: Apache-2.0
"""The examples run as they are, each in a process of its own, and stay short."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
SAYS = {
    "pair.py": "accepted",
    "stream.py": "closed",
    "own_detector.py": "masks: moved",
    "own_gate.py": "several: Reason.FEW_OBJECTS",
    "consume_constraints.py": "EDGE_SE3:QUAT 0 1",
    "objreg_to_gtsam.py": "solved: the second camera is at [0.1, 0.0, 0.02] m",
    "solve_g2o.py": "0.500000000 0.000000000 0.000000000 1.000000000",
}
NEEDS = {"consume_constraints.py": "rclpy", "objreg_to_gtsam.py": "gtsam", "solve_g2o.py": "gtsam"}
MOST_LINES = 40
MOST_BYTES = 400_000  # of the notebook with its pictures
PATIENCE_S = 900  # where every kernel has to be compiled first


def run(*arguments: str, text: str | None = None) -> str:
    """What a Python process prints; it must end well."""
    environment = {**os.environ, "PYTHONPATH": str(EXAMPLES.parent), "MPLBACKEND": "Agg"}
    done = subprocess.run(
        [sys.executable, *arguments], input=text, env=environment, capture_output=True, text=True, timeout=PATIENCE_S
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def cells(kind: str) -> list[str]:
    """The cells of the notebook of one kind."""
    notebook = json.loads((EXAMPLES / "registration.ipynb").read_text(encoding="utf-8"))
    return ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == kind]


def test_each_example_is_known_here() -> None:
    assert {path.name for path in EXAMPLES.glob("*.py")} == set(SAYS)


@pytest.mark.parametrize("name", SAYS)
def test_an_example_is_short(name: str) -> None:
    assert len((EXAMPLES / name).read_text(encoding="utf-8").splitlines()) <= MOST_LINES


@pytest.mark.slow
@pytest.mark.parametrize("name", SAYS)
def test_an_example_runs_and_says_what_it_found(name: str) -> None:
    needed = NEEDS.get(name)
    if needed is not None and find_spec(needed) is None:
        pytest.skip(f"{name} needs {needed}, which is not installed")
    assert SAYS[name] in run(str(EXAMPLES / name))


def test_the_notebook_is_one_and_is_small() -> None:
    path = EXAMPLES / "registration.ipynb"
    assert path.stat().st_size < MOST_BYTES
    assert cells("markdown") and cells("code")
    if find_spec("nbformat") is not None:
        import nbformat

        nbformat.validate(nbformat.read(path, as_version=4))


@pytest.mark.slow
def test_the_cells_of_the_notebook_run_in_their_order() -> None:
    assert "accepted" in run("-", text="\n".join(cells("code")))
