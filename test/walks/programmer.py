# SPDX-License-Identifier: Apache-2.0
"""Someone has pictures on a disk and writes Python: the lines of the README, with their own pictures and camera."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np

from .folders import tum_of
from .walk import PATIENCE_S, REPOSITORY

READS = """\
import sys
import cv2

def picture(name):
    return cv2.cvtColor(cv2.imread("mine/rgb/" + name), cv2.COLOR_BGR2RGB)

def depth(name):
    return cv2.imread("mine/depth/" + name, cv2.IMREAD_UNCHANGED).astype("float32") / 5000

rgb_1, depth_1, rgb_2, depth_2 = (read(name) for name in sys.argv[1:3] for read in (picture, depth))
fx, fy, cx, cy = map(float, sys.argv[3:])
"""
MOST_CM = 15.0


def walk(folder: Path, room: Path) -> None:
    """Two pictures beside each other give the motion between them; depth that is empty is refused with a reason."""
    mine = tum_of(room, folder / "mine", frames=4)
    (folder / "mine.py").write_text(READS + _lines_of_the_readme())
    names = sorted(path.name for path in (mine / "rgb").iterdir())
    camera = dict(line.split(": ") for line in (mine / "camera.yaml").read_text().splitlines())
    intrinsics = [camera[name] for name in ("fx", "fy", "cx", "cy")]

    accepted = _run(folder, names[0], names[1], *intrinsics)
    numbers = [float(number) for number in re.findall(r"-?\d+\.?\d*(?:e[-+]?\d+)?", accepted)]
    T_1_2 = np.reshape(numbers[:16], (4, 4))
    moved, true = T_1_2[:3, 3], _true_distance(mine / "groundtruth.txt", names[0], names[1])
    assert abs(float(np.linalg.norm(moved)) - true) < MOST_CM / 100 and len(numbers) == 16 + 36

    (folder / "mine.py").write_text(READS + "depth_2 = 0 * depth_2\n" + _lines_of_the_readme())
    assert re.match(r"Reason\.|\w+ ", _run(folder, names[0], names[1], *intrinsics))


def _lines_of_the_readme() -> str:
    """The first Python of the README, as it stands there."""
    return (REPOSITORY / "README.md").read_text(encoding="utf-8").split("```python\n")[1].partition("```")[0]


def _run(folder: Path, *arguments: str) -> str:
    """What the script prints; it must end well."""
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY), "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "mine.py", *arguments],
        cwd=folder, env=environment, capture_output=True, text=True, timeout=PATIENCE_S, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def _true_distance(file: Path, *names: str) -> float:
    """How far the camera moved between two pictures, m."""
    rows = np.loadtxt(file)
    places = [rows[np.abs(rows[:, 0] - float(Path(name).stem)).argmin(), 1:4] for name in names]
    return float(np.linalg.norm(places[1] - places[0]))
