# SPDX-License-Identifier: Apache-2.0
"""The live graph on too few cores, at several times the camera's speed: memory, constraints, and how it ends.

A simulated recording is played over and over, with stamps that go on, to three nodes that share ``--cores`` cores. Each
second the memory of every node is read, and what the registrar reports of itself. At the end it gets a SIGINT while it
is still overloaded. What it must show: its memory does not grow after a warm-up of a third of the time, constraints
keep coming, the newest keyframe's search begins within 2 s (p95), and the process ends within 5 s with everything
stored.

    python benchmarks/overload.py --seconds 600 --speed 4 --cores 1 --json overload.json

A soak is the same at the camera's speed, with a store that is soon full: what is remembered does take memory.

    python benchmarks/overload.py --seconds 3600 --speed 1 --cores 2 --keyframes 300 --json soak.json
"""

from __future__ import annotations

import json
import os
import signal
import struct
import subprocess
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
import numpy as np
from latency import Meter, recorded

from objreg_ros.memory.store import Store
from objreg_tools.cli.live import STAGES, START_S, private_environment
from objreg_tools.cli.processes import Processes
from objreg_tools.recording import open_recording
from objreg_tools.recording.inputs import choose_inputs, parse_remaps
from objreg_tools.recording.replay import graph_names

WARM_UP = 1 / 3  # of the time: memory that is taken then is not counted as growth
END_S = 120.0  # a node that has not ended by then is killed
ROWS = 12  # of the table
REPORTED = ("stored keyframes", "stored unsearched", "waiting keyframes", "constraints", "received", "published")


class Gauge:
    """Receives what the nodes report of themselves on /diagnostics, in a thread of its own."""

    def __init__(self) -> None:
        from diagnostic_msgs.msg import DiagnosticArray
        from rclpy.context import Context
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.node import Node

        from objreg_ros.bridge.node import qos

        self.latest: dict[str, dict[str, str]] = {}  # node → what it reported last
        self.rows: list[tuple[float, dict[str, str]]] = []  # when, and what the registrar reported
        self._context = Context()
        self._context.init(args=[])
        node = Node("gauge", context=self._context)
        node.create_subscription(DiagnosticArray, "/diagnostics", self._receive, qos.stage(depth=100))
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(node)
        self._thread = threading.Thread(target=self._executor.spin, daemon=True)
        self._thread.start()

    def _receive(self, message: Any) -> None:
        for status in message.status:
            name, _, what = status.name.strip("/").partition(": ")
            if what == "frames":
                self.latest[name] = {pair.key: pair.value for pair in status.values}
                if name == "registrar":
                    self.rows.append((time.monotonic(), self.latest[name]))

    def close(self) -> None:
        """End it."""
        self._executor.shutdown()
        self._thread.join(5.0)
        self._context.try_shutdown()


@contextmanager
def on_cores(count: int) -> Iterator[None]:
    """What is started meanwhile runs on the first so many cores that this process may use."""
    mine = os.sched_getaffinity(0)
    os.sched_setaffinity(0, sorted(mine)[:count])
    try:
        yield
    finally:
        os.sched_setaffinity(0, mine)


def shifted(cdr: bytes, by_ns: int) -> bytes:
    """A serialised message that begins with a header, with a later stamp in it."""
    seconds, nanoseconds = struct.unpack_from("<iI", cdr, 4)  # behind the encapsulation
    later = seconds * 1_000_000_000 + nanoseconds + by_ns
    return cdr[:4] + struct.pack("<iI", *divmod(later, 1_000_000_000)) + cdr[12:]


def endless(messages: Sequence[tuple[str, int, bytes]], seconds: float) -> Iterator[Any]:
    """The messages (topic, stamp, bytes) over and over for so many seconds of their own time, as items of a player."""
    from objreg_ros.bridge.streams.player import PlayedMessage

    first_ns, last_ns = messages[0][1], messages[-1][1]
    period_ns = last_ns - first_ns + (last_ns - first_ns) * 3 // len(messages)
    by_ns = 0
    while True:
        for topic, stamp_ns, cdr in messages:
            if stamp_ns + by_ns - first_ns > seconds * 1e9:
                return
            yield PlayedMessage(topic, stamp_ns + by_ns, shifted(cdr, by_ns))
        by_ns += period_ns


def play(path: Path, seconds: float, speed: float) -> None:
    """Play a recording for so many seconds at so many times its speed."""
    import rclpy

    from objreg_ros.bridge.streams.player import Player

    with open_recording(path) as source:
        names = graph_names(source, choose_inputs(source.topics, parse_remaps(())))
        messages = [(names[record.topic], record.stamp_ns, record.cdr) for record in source.records(set(names))]
        kinds = {out: source.topics[topic].msgtype for topic, out in names.items()}
    rclpy.init(args=[])
    player = Player(kinds)
    try:
        player.wait_for_listeners(names.values(), 30.0)
        player.play(endless(messages, seconds * speed), speed, lambda item: None)
    finally:
        player.close()
        rclpy.try_shutdown()


def seconds_to_end(process: subprocess.Popen[bytes]) -> float | None:
    """From SIGINT to the end of a process; None where it had to be killed."""
    begun = time.monotonic()
    process.send_signal(signal.SIGINT)
    try:
        process.wait(END_S)
    except subprocess.TimeoutExpired:
        process.kill()
        return None
    return time.monotonic() - begun


def slope_mb_per_hour(samples: Sequence[tuple[float, ...]], start: float) -> float:
    """How fast memory grew from a moment on; each sample begins with its time and ends with its megabytes."""
    at, memory = np.array([(row[0], row[-1]) for row in samples if row[0] >= start]).T
    return float(np.polyfit(at - at[0], memory, 1)[0] * 3600) if len(at) > 2 else float("nan")


def measure(path: Path, seconds: float, speed: float, cores: int, keyframes: int, folder: Path) -> dict[str, Any]:
    """One overloaded run."""
    store = folder / "place.db"
    environment = private_environment()
    os.environ.update(environment)
    with Processes(folder, environment) as processes:
        meter, gauge = Meter(), Gauge()
        with on_cores(cores):
            for stage in STAGES:
                kept = ("-p", f"store:={store}", "-p", f"max_keyframes:={keyframes}")
                more = ["--ros-args", *kept] if stage == "registrar" else []
                node = processes.start(stage, f"objreg_ros.{stage}.node", more)
        _wait_for_nodes(gauge, processes)
        start = time.monotonic()
        play(path, seconds, speed)
        stop, last = time.monotonic(), dict(gauge.latest.get("registrar", {}))
        processes.require_alive()
        missing = {stage: unaccounted(gauge.latest[stage]) for stage in STAGES}
        ended = seconds_to_end(node)
        gauge.close()
        usage = meter.figures(start, stop)
    with_store = Store(store, read_only=True)
    stored = with_store.counts()["keyframes"]
    with_store.close()
    warm = start + WARM_UP * (stop - start)
    return {
        "seconds": stop - start,
        "registrar": last,
        "stored_in_file": stored,
        "seconds_from_sigint": ended,
        "unaccounted": missing,
        "usage": usage,
        "slope_mb_per_hour": {stage: slope_mb_per_hour(meter.samples[stage], warm) for stage in STAGES},
        "memory_mb": {stage: [(at - start, mb) for at, _, mb, _ in meter.samples[stage]] for stage in STAGES},
        "rows": [
            {"at": at - start, **{key: values.get(key) for key in REPORTED}} for at, values in gauge.rows if at >= start
        ],
    }


def unaccounted(values: Mapping[str, str]) -> int:
    """The frames of a node whose end its counters do not say: 0 where they balance."""
    dropped = sum(int(count) for key, count in values.items() if key.startswith("dropped: "))
    return int(values["received"]) - int(values["published"]) - int(values["waiting"]) - dropped


def _wait_for_nodes(gauge: Gauge, processes: Processes) -> None:
    deadline = time.monotonic() + START_S
    while not set(STAGES) <= gauge.latest.keys():
        processes.require_alive()
        if time.monotonic() > deadline:
            raise click.ClickException(f"expected {', '.join(STAGES)} to report, got {sorted(gauge.latest)}")
        time.sleep(0.2)


def table_of(figures: Mapping[str, Any]) -> str:
    """The run in a few lines: memory and counts over time, then the figures."""
    lines = ["    s  registrar MB  keyframes  unsearched  waiting  constraints"]
    at, memory = np.array(figures["memory_mb"]["registrar"]).T
    rows = figures["rows"]
    for row in rows[:: max(len(rows) // ROWS, 1)]:
        mb = float(np.interp(row["at"], at, memory))
        counts = [row[key] for key in ("stored keyframes", "stored unsearched", "waiting keyframes", "constraints")]
        lines.append("{:5.0f}  {:12.1f}  {:>9}  {:>10}  {:>7}  {:>11}".format(row["at"], mb, *map(str, counts)))
    slopes = ", ".join(f"{stage} {slope:+.1f}" for stage, slope in figures["slope_mb_per_hour"].items())
    last, ended = figures["registrar"], figures["seconds_from_sigint"]
    age = [last.get(f"latency wait {share} [ms]") for share in ("p50", "p95")]
    return "\n".join(
        (
            *lines,
            f"growth of memory after the warm-up, MB/h: {slopes}",
            f"age of the newest keyframe when its search begins, p50 and p95 [ms]: {age[0]} {age[1]}",
            f"frames that the counters do not account for: {figures['unaccounted']}",
            f"stored in the file {figures['stored_in_file']}",
            f"seconds from SIGINT to the end: {'killed' if ended is None else f'{ended:.1f}'}",
        )
    )


@click.command()
@click.option("--seconds", default=600.0, show_default=True, help="How long to play.")
@click.option("--speed", default=4.0, show_default=True, help="Times the camera's speed.")
@click.option("--cores", default=1, show_default=True, help="Cores that the three nodes share.")
@click.option("--keyframes", default=20000, show_default=True, help="Most that the store keeps.")
@click.option("--objects", default=4, show_default=True, help="Objects in view.")
@click.option("--frames", default=300, show_default=True, help="Frames of the recording that is played over and over.")
@click.option("--seed", default=0, show_default=True, help="Seed of the simulated recording.")
@click.option("--recording", type=click.Path(exists=True, path_type=Path), help="Play this one instead.")
@click.option("--json", "json_file", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
def main(
    seconds: float,
    speed: float,
    cores: int,
    keyframes: int,
    objects: int,
    frames: int,
    seed: int,
    recording: Path | None,
    json_file: Path | None,
) -> None:
    """Overload the live graph, and report how it bears that."""
    with tempfile.TemporaryDirectory() as folder:
        if recording is not None:
            figures = measure(recording, seconds, speed, cores, keyframes, Path(folder))
        else:
            with recorded(objects, frames, seed) as path:
                figures = measure(path, seconds, speed, cores, keyframes, Path(folder))
    click.echo(table_of(figures))
    if json_file is not None:
        json_file.write_text(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()
