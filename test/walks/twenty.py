# SPDX-License-Identifier: Apache-2.0
"""Someone has twenty recordings of a day, of which one was cut off: all are run, and the page says which failed."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

from .folders import bag_of
from .trying import body
from .walk import Walk

COUNT, BROKEN = 20, "day_13"
FRAMES = ("--max-frames", "3")


def walk(folder: Path, room: Path) -> None:
    """One that fails stops no other, and those that are done are not run again when it has been put right."""
    bag_of(room, folder / "whole", seconds=4.0)
    names = [f"day_{number:02}" for number in range(1, COUNT + 1)]
    for name in names:
        shutil.copytree(folder / "whole", folder / name, copy_function=os.link)
    bag = next((folder / BROKEN).glob("*.mcap"))
    content = bag.read_bytes()
    bag.unlink()
    bag.write_bytes(b"")

    someone = Walk(folder)
    words = ("batch", *names, "--out", "runs", *FRAMES, "--no-pages")
    failed = someone.type(*words, ends=3)
    assert "recordings: 20, failed: 1, frames: 57" in failed.output and "seems to be empty" in failed.output
    page = body(folder / "runs/report.html")
    assert BROKEN in page and all(name in page for name in names)
    assert len([*(folder / "runs").glob("day_*.json")]) == COUNT - 1

    bag.write_bytes(content)
    whole = someone.type(*words)
    assert (
        "19 of 20 recordings are done already" in whole.text and "recordings: 20, failed: 0, frames: 60" in whole.output
    )
    assert json.loads(next((folder / "runs").glob(f"{BROKEN}*.json")).read_text())["frames"] == 3
