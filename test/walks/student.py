# SPDX-License-Identifier: Apache-2.0
"""A student has a TUM folder and wants to see whether loops close: inspect, offline, report."""

from __future__ import annotations

from pathlib import Path

from .folders import tum_of
from .walk import Walk


def walk(folder: Path, room: Path) -> None:
    """Follow what each command names, from the folder to the page."""
    tum_of(room, folder / "mine", frames=20)
    student = Walk(folder)

    seen = student.type("inspect", "mine")
    assert "TUM RGB-D folder" in seen.text and "no odometry" in seen.text

    run = student.follow(seen)
    assert "the camera never left: " in run.text and "; none of the " in run.text

    shown = student.follow(run)
    assert "wrote report.html; open it in a browser" in shown.text
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "none of the " in page and "All pairs" in page
