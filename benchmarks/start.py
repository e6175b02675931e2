# SPDX-License-Identifier: Apache-2.0
"""How long processes take to start, and their memory then: each node, the library, all nodes in one process.

Every row is a fresh process, measured from its start until a node is made and listens, or until the first `register()`
has returned. A plain loop of Python stands beside them, so that machines can be compared. Nothing is compiled at a
start; a build before is not counted.

    python benchmarks/start.py --json start.json
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import Any

import click

NODE = """
import rclpy
from objreg_ros.{stage}.node import {name} as Node
rclpy.init()
node = Node()
"""
COMPOSED = """
import rclpy
from objreg_ros.detector.node import DetectorNode
from objreg_ros.segmenter.node import SegmenterNode
from objreg_ros.registrar.node import RegistrarNode
rclpy.init()
nodes = [Node() for Node in (DetectorNode, SegmenterNode, RegistrarNode)]
"""
REGISTER = """
import numpy as np
from objreg_ros import Camera, register
v, u = np.mgrid[:480, :640]
depth = (1.6 - 0.00125 * v).astype(np.float32)
depth[(v // 120 == 1) & (u // 80 % 4 == 1)] -= 0.2
rgb = np.repeat(((u * u // 7 + v * 13) % 256).astype(np.uint8)[..., None], 3, axis=2)
register(rgb, depth, rgb, depth, Camera(525.0, 525.0, 319.5, 239.5))
"""
END = """
import os
lines = dict(line.split(":", 1) for line in open("/proc/self/status"))
print(int(lines["VmHWM"].split()[0]) / 1024, flush=True)
os._exit(0)
"""
PROCESSES = {
    "Python alone": "",
    "numpy and OpenCV": "import numpy, cv2",
    "detector": NODE.format(stage="detector", name="DetectorNode"),
    "segmenter": NODE.format(stage="segmenter", name="SegmenterNode"),
    "registrar": NODE.format(stage="registrar", name="RegistrarNode"),
    "keyframer": NODE.format(stage="keyframes", name="KeyframerNode"),
    "detector, segmenter and registrar in one": COMPOSED,
    "first register() of the library": REGISTER,
}
LOOP = 3_000_000


def start(code: str, folder: Path) -> tuple[float, float]:
    """The seconds of a fresh process until its code has run, and its memory then in MB."""
    alone = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_DOMAIN_ID": "77", "ROS_LOG_DIR": str(folder)}
    begun = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", code + END], env=os.environ | alone, capture_output=True, text=True, check=True
    )
    return time.perf_counter() - begun, float(done.stdout.split()[-1])


def plain_loop() -> float:
    """The seconds of a loop of Python that adds numbers."""
    begun, total = time.perf_counter(), 0
    for k in range(LOOP):
        total += k
    return time.perf_counter() - begun


def measure(rounds: int, folder: Path) -> dict[str, dict[str, Any]]:
    """The medians of so many rounds, in which every process has its turn."""
    seen: dict[str, list[tuple[float, float]]] = {name: [] for name in PROCESSES}
    loops = []
    for _ in range(rounds):
        loops.append(plain_loop())
        for name, code in PROCESSES.items():
            seen[name].append(start(code, folder))
    figures = {
        name: {"seconds": median(s for s, _ in taken), "megabytes": median(mb for _, mb in taken)}
        for name, taken in seen.items()
    }
    return {f"a loop of {LOOP:,} additions": {"seconds": median(loops), "megabytes": None}, **figures}


@click.command(help=__doc__.split("\n")[0])
@click.option("--rounds", default=5, show_default=True, help="How often each process is started.")
@click.option("--json", "out", type=Path, help="Write the figures here.")
def main(rounds: int, out: Path | None) -> None:
    """Print the table."""
    with tempfile.TemporaryDirectory() as folder:
        figures = measure(rounds, Path(folder))
    for name, row in figures.items():
        memory = "" if row["megabytes"] is None else f"{row['megabytes']:6.0f} MB"
        click.echo(f"{name:42s} {row['seconds']:6.2f} s  {memory}")
    if out is not None:
        out.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
