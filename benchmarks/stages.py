# SPDX-License-Identifier: Apache-2.0
"""What the registrar costs, stage by stage, without ROS: the 30 Hz path, and the whole search of a keyframe.

``track`` is what every frame costs (tracking, keyframing), ``search`` what a keyframe costs: it is fused, made ready,
compared with the stored keyframes that may show the same place, and stored; ``keep`` is the same without a comparison,
as for a keyframe that a newer one overtook. The times are of this machine as it was, so leave it alone meanwhile.

    python benchmarks/stages.py REC --model MODEL
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np
from sources import detector_of, read_source

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import Frame
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.registrar import Registrar

VARIANTS = ("with_odometry", "without_odometry")


class Clock:
    """Durations by stage."""

    def __init__(self) -> None:
        self._seconds: dict[str, list[float]] = {}

    def timed(self, stage: str, work: Callable[[], Any]) -> Any:
        """What ``work`` gives, its duration booked."""
        start = time.perf_counter()
        answer = work()
        self._seconds.setdefault(stage, []).append(time.perf_counter() - start)
        return answer

    def figures(self) -> dict[str, dict[str, float]]:
        """How often and how long, in ms."""
        return {stage: _figures(1e3 * np.array(seconds)) for stage, seconds in self._seconds.items()}


def _figures(ms: Array) -> dict[str, float]:
    percentiles = {f"ms_p{q}": round(float(np.percentile(ms, q)), 2) for q in (50, 95, 100)}
    return {"count": float(len(ms)), **percentiles}


def run(frames: Sequence[Frame], params: RegistrarParams) -> dict[str, Any]:
    """The stages of one registrar over the frames, and of one that has no time to search."""
    clock = Clock()
    closures = 0
    for stage, seconds in (("search", np.inf), ("keep", 0.0)):
        registrar = Registrar(params)
        for frame in frames:
            track = lambda: registrar.track(frame)  # noqa: B023, E731
            window = clock.timed("track", track) if stage == "search" else track()
            if window is not None:
                outcome = clock.timed(stage, lambda: registrar.search(window, seconds))  # noqa: B023
                closures += len(outcome.closures)
        registrar.close()
    return {"closures": closures, "stages": clock.figures()}


def compare(frames: Sequence[Frame], params: RegistrarParams) -> dict[str, Any]:
    """With the odometry of the frames and without."""
    bare = [replace(frame, T_odom_camera=None) for frame in frames]
    return {name: run(taken, params) for name, taken in zip(VARIANTS, (frames, bare), strict=True)}


def table(name: str, row: dict[str, Any]) -> str:
    """One recording as text."""
    lines = [name]
    for variant in VARIANTS:
        for stage, cost in row[variant]["stages"].items():
            numbers = "  ".join(f"{key[3:]} {cost[key]:8.2f} ms" for key in ("ms_p50", "ms_p95", "ms_p100"))
            lines.append(f"  {variant:17} {stage:7} {cost['count']:5.0f} x  {numbers}")
    return "\n".join(lines)


@click.command()
@click.argument("recordings", nargs=-1, required=True, type=click.Path(exists=True, path_type=Path))
@click.option("--threads", default=2, show_default=True, help="Stored keyframes that are tried at once.")
@click.option("--model", default="", help="ONNX model; `truth` takes the true boxes of a simulated recording.")
@click.option("--json", "json_file", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
@click.option("--seed", default=1, show_default=True, help="Seed of the synthetic drift.")
def main(recordings: tuple[Path, ...], threads: int, model: str, json_file: Path | None, seed: int) -> None:
    """Measure the stages of the registrar on RECORDINGS that have ground truth."""
    params = RegistrarParams(threads=threads)
    rows: dict[str, Any] = {}
    for path in recordings:
        with read_source(path, detector_of(model), seed) as source:
            rows[path.name] = compare(source.frames, params)
        click.echo(table(path.name, rows[path.name]))
    if json_file is not None:
        json_file.write_text(json.dumps({"cpus": os.cpu_count(), "threads": threads, "recordings": rows}, indent=1))


if __name__ == "__main__":
    main()
