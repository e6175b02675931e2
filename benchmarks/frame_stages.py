# SPDX-License-Identifier: Apache-2.0
"""Where the milliseconds of a frame go in the live graph, node by node: processor and wall milliseconds of every stage.

A simulated recording is played in real time through the node processes, or with ``--composed`` through the one process.
Processor milliseconds are all of the run, over the frames that the registrar followed: what runs on other frames
(surplus pictures, keyframes, odometry) is spread over those. Wall milliseconds are of one run of the stage. What no
stage has is ``other``: the executor, DDS's threads, threads of libraries.

    python benchmarks/frame_stages.py --objects 4 --json frame_stages.json
"""

from __future__ import annotations

import json
import os
import random
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click
import numpy as np
from latency import recorded
from tables import RATE_HZ
from timed_node import FOLDER

from objreg_tools.cli.live import STAGES, Setup, run_live

OTHER = "other"


def stages_of(path: Path, composed: bool) -> tuple[int, dict[str, Any]]:
    """How many frames were followed, and what each process wrote down."""
    names = ("graph",) if composed else STAGES
    with tempfile.TemporaryDirectory() as folder:
        os.environ[FOLDER] = folder
        setup = Setup(composed=composed, programs={name: ("timed_node", name) for name in names})
        live = run_live(path, setup, Path(folder), lambda line: click.echo(line, err=True))
        return live.counters["registrar"].published, {
            name: json.loads(Path(folder, f"{name}.json").read_text()) for name in names
        }


def table_of(frames: int, process: Mapping[str, Any]) -> dict[str, dict[str, float]]:
    """The rows of one process, the dearest first; of them ``other`` and ``all``."""
    rows = {}
    for stage, runs in process["stages"].items():
        wall, cpu = 1e3 * np.array(runs).T
        p50, p95 = np.percentile(wall, (50, 95))
        rows[stage] = {
            "runs": float(len(runs)),
            "cpu_ms": round(float(cpu.sum()) / frames, 2),
            "wall_ms_p50": round(float(p50), 2),
            "wall_ms_p95": round(float(p95), 2),
        }
    whole = round(1e3 * process["processor_seconds"] / frames, 2)
    rows[OTHER] = {"cpu_ms": round(whole - sum(row["cpu_ms"] for row in rows.values()), 2)}
    ordered = dict(sorted(rows.items(), key=lambda row: -row[1]["cpu_ms"]))
    percent = round(100 * process["processor_seconds"] / process["seconds"], 1)
    return {**ordered, "all": {"cpu_ms": whole, "cpu_percent": percent}}


def text_of(name: str, rows: Mapping[str, Mapping[str, float]]) -> str:
    """A process as text."""
    lines = [f"{name:24} {'runs':>6} {'cpu ms':>8} {'wall p50':>9} {'p95':>8}"]
    for stage, row in rows.items():
        wall = f"{row['wall_ms_p50']:9.2f} {row['wall_ms_p95']:8.2f}" if "wall_ms_p50" in row else ""
        share = f"  {row['cpu_percent']} % of a core" if "cpu_percent" in row else ""
        lines.append(f"  {stage:22} {row.get('runs', 0):6.0f} {row['cpu_ms']:8.2f} {wall}{share}")
    return "\n".join(lines)


@click.command()
@click.option("--objects", default=4, show_default=True, help="Objects in view.")
@click.option("--seconds", default=10.0, show_default=True, help="Length of the run, at 30 frames a second.")
@click.option("--seed", default=0, show_default=True, help="Seed of the simulated recording.")
@click.option("--composed", is_flag=True, help="All nodes in one process.")
@click.option("--json", "json_file", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
def main(objects: int, seconds: float, seed: int, composed: bool, json_file: Path | None) -> None:
    """Measure the stages of a frame in the live graph."""
    os.environ.setdefault("ROS_DOMAIN_ID", str(random.randint(1, 100)))
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    here = str(Path(__file__).parent)
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, (here, os.environ.get("PYTHONPATH", ""))))
    with recorded(objects, round(RATE_HZ * seconds), seed) as path:
        frames, processes = stages_of(path, composed)
    tables = {name: table_of(frames, process) for name, process in processes.items()}
    for name, rows in tables.items():
        click.echo(text_of(name, rows))
    if json_file is not None:
        json_file.write_text(json.dumps({"objects": objects, "frames": frames, "processes": tables}, indent=1))


if __name__ == "__main__":
    main()
