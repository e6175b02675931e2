# SPDX-License-Identifier: Apache-2.0
"""A researcher runs one recording twice with other parameters, compares, and reads the trajectory and the JSON."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import numpy as np

from .walk import Walk

FRAMES = 24
STRICT = "registrar.least_odds=30"


def walk(folder: Path, room: Path) -> None:
    """Leaves a.json, b.json, way.txt and both.html in the folder."""
    researcher = Walk(folder)
    words = ("offline", str(room), "--max-frames", str(FRAMES))
    first = researcher.type(*words, "--json", "a.json", "--tum", "way.txt")
    assert first.command() == ["report", "a.json"]
    second = researcher.type(*words, "--json", "b.json", "--set", STRICT)
    assert second.command() == ["report", "b.json"]

    shown = researcher.type("report", "a.json", "b.json", "--out", "both.html")
    assert "wrote both.html; open it in a browser" in shown.text
    page = (folder / "both.html").read_text(encoding="utf-8")
    assert "least_odds" in page and "gained" in page and "lost" in page

    _read_the_way(folder / "way.txt")
    _read_how_it_was_made(folder)


def _read_the_way(file: Path) -> None:
    """Rows of stamp tx ty tz qx qy qz qw, as evo reads them."""
    way = np.loadtxt(file)
    assert way.shape == (FRAMES, 8) and (np.diff(way[:, 0]) > 0).all()
    assert np.allclose(np.linalg.norm(way[:, 4:], axis=1), 1, atol=1e-6)
    assert np.linalg.norm(np.diff(way[:, 1:4], axis=0), axis=1).sum() > 1.0  # m


def _read_how_it_was_made(folder: Path) -> None:
    """The one thing that differs, and a command that can be typed again."""
    a, b = (json.loads((folder / name).read_text()) for name in ("a.json", "b.json"))
    assert a["about"]["params"] == {} and list(b["about"]["params"]) == [STRICT.partition("=")[0]]
    assert a["about"]["model"] == b["about"]["model"] and a["about"]["version"]
    assert STRICT in shlex.split(b["about"]["command"])
    assert a["constraints"] and len(b["constraints"]) <= len(a["constraints"])
