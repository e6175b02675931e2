# SPDX-License-Identifier: Apache-2.0
"""The live graph at the camera's rate with 1, 4 and 8 objects in view: latency, processor, memory, and what was lost.

Simulated recordings are played in real time through the three node processes. A frame's end-to-end latency is from the
arrival of its image until a node is done with it, the registrar until the camera is followed to it; what the search of
a keyframe takes after that is `search_ms`. A constraint's latency is from the arrival of the image that it is about:
until its keyframe is complete (a second at most), searched for and published. Those that came with the search of their
own keyframe are `at_once`: `keyframe` of that the keyframe took to be complete. Others were held for the `proof` of
the camera, which is over with the first constraint, or waited for `others` to confirm them. The counters say what every
node dropped and why: in = out + dropped.

    python benchmarks/latency.py --json latency.json
    python benchmarks/latency.py --objects 4 --seconds 40     long enough for constraints after the proof
    python benchmarks/latency.py --objects 4 --composed 3     three processes and one in turn, three times each
"""

from __future__ import annotations

import json
import os
import random
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
import numpy as np
from tables import RATE_HZ, table_plan

from objreg_tools.cli.live import STAGES, Live, Setup, run_live
from objreg_tools.simulation.write import write_plan

PROGRAMS = {**{stage: f"objreg_ros.{stage}.node" for stage in STAGES}, "graph": "objreg_tools.graph"}
TICKS = os.sysconf("SC_CLK_TCK")
ORDER_S = 0.02  # messages of two topics that were sent in this order may come in the other


class Witness:
    """Receives images and acknowledgements, and remembers when."""

    def __init__(self) -> None:
        import rclpy
        from nav_msgs.msg import Odometry
        from rclpy.context import Context
        from rclpy.executors import SingleThreadedExecutor
        from sensor_msgs.msg import CompressedImage
        from std_msgs.msg import Header

        from objreg_ros.bridge.messages.headers import stamp_ns
        from objreg_ros.bridge.node import qos

        self.seen: dict[int, float] = {}
        self.done: dict[tuple[str, int], float] = {}
        self.searched: dict[int, float] = {}  # of each frame that completed a keyframe, when its search was over
        self.constraints: list[tuple[int, float]] = []  # of each constraint the image that it is about, and when
        self._stamp_ns = stamp_ns
        self._context = Context()
        self._context.init()
        self._node = rclpy.create_node("witness", context=self._context)
        self._node.create_subscription(CompressedImage, "image/compressed", self._see, qos.sensor(True))
        self._node.create_subscription(Header, "finished", self._finish, qos.stage(depth=1000))
        self._node.create_subscription(Odometry, "constraints", self._receive, qos.latched(qos.KEPT_CONSTRAINTS))
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._executor.spin, daemon=True)
        self._thread.start()

    def _see(self, message: Any) -> None:
        self.seen[self._stamp_ns(message)] = time.monotonic()

    def _finish(self, acknowledgement: Any) -> None:
        node, verdict, *_ = acknowledgement.frame_id.split(" ")
        frame, now = (node, self._stamp_ns(acknowledgement)), time.monotonic()
        if verdict == "published" and frame in self.done:
            self.searched[frame[1]] = now
        elif verdict in ("followed", "published"):
            self.done[frame] = now

    def _receive(self, constraint: Any) -> None:
        self.constraints.append((self._stamp_ns(constraint), time.monotonic()))

    @property
    def span(self) -> tuple[float, float]:
        """From the first image to the last acknowledgement, in seconds of the clock that never jumps.

        `click.ClickException` where nothing was received.
        """
        if not self.seen or not self.done:
            raise click.ClickException(
                "expected images on image/compressed and acknowledgements on finished, "
                f"got {len(self.seen)} and {len(self.done)}; does the ROS_DOMAIN_ID reach this process?"
            )
        return min(self.seen.values()), max(self.done.values())

    def latency_ms(self, node: str) -> dict[str, float]:
        """p50 and p95 from the image to the node's acknowledgement, and of how many frames."""
        return self._latency_ms([(stamp, at) for (name, stamp), at in self.done.items() if name == node])

    def search_ms(self) -> dict[str, float]:
        """The same from there to the end of the search, of the frames that completed a keyframe."""
        return _figures([1e3 * (at - self.done["registrar", stamp]) for stamp, at in self.searched.items()])

    def constraint_ms(self) -> dict[str, dict[str, float]]:
        """The same to the constraints about an image: of all, and by what they waited for."""
        kinds: dict[str, list[tuple[int, float]]] = {"at_once": [], "proof": [], "others": []}
        first = min((at for _, at in self.constraints), default=np.inf)
        for stamp, at in self.constraints:
            if stamp in self.seen:
                own = at < self._searched_at(stamp) + ORDER_S
                kinds["at_once" if own else "proof" if self.seen[stamp] < first else "others"].append((stamp, at))
        completed = [(stamp, self.done["registrar", self._completing(stamp)]) for stamp, _ in kinds["at_once"]]
        apart = {name: self._latency_ms(ends) for name, ends in kinds.items()}
        return {"all": self._latency_ms(self.constraints), **apart, "keyframe": self._latency_ms(completed)}

    def _completing(self, stamp_ns: int) -> int:
        """The frame that completed the keyframe which an image is of; 0 for none."""
        return min((stamp for stamp in self.searched if stamp >= stamp_ns), default=0)

    def _searched_at(self, stamp_ns: int) -> float:
        return self.searched.get(self._completing(stamp_ns), -np.inf)

    def _latency_ms(self, ends: Sequence[tuple[int, float]]) -> dict[str, float]:
        return _figures([1e3 * (at - self.seen[stamp]) for stamp, at in ends if stamp in self.seen])

    def close(self) -> None:
        """End the node."""
        self._executor.shutdown()
        self._thread.join(5.0)
        self._node.destroy_node()
        self._context.try_shutdown()


def _figures(times: Sequence[float]) -> dict[str, float]:
    if not times:
        return {"frames": 0.0}
    p50, p95 = np.percentile(times, (50, 95))
    return {"frames": float(len(times)), "p50": round(float(p50), 2), "p95": round(float(p95), 2)}


class Meter:
    """The processor time and the memory of the node processes that this one started, sampled each second."""

    def __init__(self) -> None:
        self.samples: dict[str, list[tuple[float, float, float, float]]] = {name: [] for name in PROGRAMS}
        self._open = True
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while self._open:
            for pid in _children(os.getpid()):
                program = next((name for name, module in PROGRAMS.items() if module in _command(pid)), None)
                sample = _sample(pid)
                if program is not None and sample is not None:
                    self.samples[program].append((time.monotonic(), *sample))
            time.sleep(1.0)

    def figures(self, start: float, stop: float) -> dict[str, dict[str, float]]:
        """Process → share of one core between the two moments, and the largest memory in MB.

        ``pss_mb`` counts what processes share once.
        """
        self._open = False
        self._thread.join()
        out = {}
        for program, rows in self.samples.items():
            if len(rows) < 2:
                continue
            at, seconds, memory, fair = np.array(rows).T
            cpu = 100 * np.diff(np.interp((start, stop), at, seconds))[0] / (stop - start)
            most = {"memory_mb": round(float(memory.max()), 1), "pss_mb": round(float(fair.max()), 1)}
            out[program] = {"cpu_percent": round(float(cpu), 1), **most}
        return out


def _children(parent: int) -> list[int]:
    """The processes that this one started."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            text = stat.read_text()
        except OSError:
            continue  # it has just ended
        if int(text.rpartition(")")[2].split()[1]) == parent:
            found.append(int(stat.parent.name))
    return found


def _command(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/cmdline").read_text()
    except OSError:
        return ""


def _sample(pid: int) -> tuple[float, float, float] | None:
    """Processor seconds, resident megabytes and proportional ones; None for a process that has ended."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
        shares = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    except OSError:
        return None
    fair = next((1.024e-3 * int(line.split()[1]) for line in shares if line.startswith("Pss:")), 0.0)
    return (int(fields[11]) + int(fields[12])) / TICKS, pages * os.sysconf("SC_PAGE_SIZE") / 1e6, fair


@contextmanager
def recorded(objects: int, frames: int, seed: int) -> Iterator[Path]:
    """The recording of a table, gone afterwards."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f"table_{objects}")
        write_plan(path, table_plan(objects, frames, seed), "table", seed, jpeg=True)
        yield path


def frames_of(live: Live) -> dict[str, Any]:
    """What became of every frame at every node, and how long its stages took."""
    return {
        node: {
            "received": balance.received,
            "published": balance.published,
            "dropped": balance.dropped,
            "unaccounted": balance.received - balance.published - balance.waiting - sum(balance.dropped.values()),
            "lost_in_transport": balance.lost,
            "stage_ms": {stage: {"p50": p50, "p95": p95} for stage, (p50, p95) in balance.stage_ms.items()},
        }
        for node, balance in live.counters.items()
    }


def measure(path: Path, setup: Setup) -> dict[str, Any]:
    """One recording through the live graph."""
    with tempfile.TemporaryDirectory() as logs:
        witness, meter = Witness(), Meter()
        try:
            live = run_live(path, setup, Path(logs), lambda line: click.echo(line, err=True))
            usage = meter.figures(*witness.span)
            latency = {node: witness.latency_ms(node) for node in STAGES}
            constraints, search = witness.constraint_ms(), witness.search_ms()
        finally:
            witness.close()
        figures = {"end_to_end_ms": latency, "search_ms": search, "constraint_ms": constraints}
        return {**figures, "frames": frames_of(live), "usage": usage}


def totals(usage: Mapping[str, Mapping[str, float]]) -> dict[str, float]:
    """The three nodes together."""
    names = ("cpu_percent", "memory_mb", "pss_mb")
    return {name: round(sum(figures.get(name, 0.0) for figures in usage.values()), 1) for name in names}


def line_of(row: Mapping[str, Any]) -> str:
    """One run in a line."""
    end_to_end, constraints = row["end_to_end_ms"]["registrar"], row["constraint_ms"]
    usage = f"usage {row['usage']}, together {totals(row['usage'])}"
    return f"end to end {end_to_end}, search {row['search_ms']}, constraints {constraints}, {usage}"


def compare(path: Path, node_args: Mapping[str, list[str]], rounds: int) -> dict[str, Any]:
    """Three processes and one in turn, so that what else the machine does weighs on both; and the median ratios."""
    runs: dict[str, list[dict[str, Any]]] = {"three": [], "one": []}
    for _ in range(rounds):
        for name, found in runs.items():
            found.append(measure(path, Setup(node_args=node_args, composed=name == "one")))
            click.echo(f"{name}: {line_of(found[-1])}")
    pairs = [(_compared(one), _compared(three)) for one, three in zip(runs["one"], runs["three"], strict=True)]
    ratios = {name: [round(one[name] / three[name], 3) for one, three in pairs] for name in pairs[0][0]}
    return {**runs, "ratios": ratios, "median": {name: float(np.median(found)) for name, found in ratios.items()}}


def _compared(row: Mapping[str, Any]) -> dict[str, float]:
    end_to_end = row["end_to_end_ms"]["registrar"]
    return {**totals(row["usage"]), "p50_ms": end_to_end["p50"], "p95_ms": end_to_end["p95"]}


@click.command()
@click.option("--objects", default="1,4,8", show_default=True, help="Objects in view, one run each.")
@click.option("--seconds", default=10.0, show_default=True, help="Length of a run, at 30 frames a second.")
@click.option("--seed", default=0, show_default=True, help="Seed of the simulated recordings.")
@click.option("--model", default="", help="ONNX model of the detector, if not the default.")
@click.option("--max-rate", type=float, help="The detector's max_rate, if not the default.")
@click.option("--composed", default=0, help="Compare so many runs in three processes and in one, in turn.")
@click.option("--json", "json_file", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
def main(
    objects: str, seconds: float, seed: int, model: str, max_rate: float | None, composed: int, json_file: Path | None
) -> None:
    """Measure the live graph's latency."""
    os.environ.setdefault("ROS_DOMAIN_ID", str(random.randint(1, 100)))  # the witness listens there too
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    changes = {"model": model or None, "max_rate": max_rate}
    arguments = [
        argument for name, value in changes.items() if value is not None for argument in ("-p", f"{name}:={value}")
    ]
    node_args = {"detector": arguments} if arguments else {}
    rows = {}
    for count in (int(text) for text in objects.split(",")):
        with recorded(count, round(RATE_HZ * seconds), seed) as path:
            if composed:
                rows[str(count)] = compare(path, node_args, composed)
                click.echo(f"{count} objects, one process over three: {rows[str(count)]['median']}")
            else:
                rows[str(count)] = measure(path, Setup(node_args=node_args))
                click.echo(f"{count} objects: {line_of(rows[str(count)])}")
    if json_file is not None:
        json_file.write_text(json.dumps({"rate_hz": RATE_HZ, "objects": rows}, indent=1))


if __name__ == "__main__":
    main()
