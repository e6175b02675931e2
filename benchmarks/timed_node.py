# SPDX-License-Identifier: Apache-2.0
"""A node of the graph that writes down, as it ends, where its milliseconds went: ``python -m timed_node NAME …``.

Where stages are within each other, each has its own time alone. The file is NAME.json in the folder that
`FOLDER` names, with the wall and processor seconds of each time that a stage was run.
"""

from __future__ import annotations

import json
import os
import runpy
import sys
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

FOLDER = "OBJREG_STAGES_FOLDER"
MODULES = {
    "detector": "objreg_ros.detector.node",
    "segmenter": "objreg_ros.segmenter.node",
    "registrar": "objreg_ros.registrar.node",
    "graph": "objreg_tools.graph",
}
CONVERTED = ("detections_table", "objects", "view", "view_camera_info", "gravity")


class Stages:
    """The seconds of every stage, of all threads."""

    def __init__(self) -> None:
        self.runs: defaultdict[str, list[tuple[float, float]]] = defaultdict(list)  # wall and processor seconds
        self._inner = threading.local()
        self._begun: tuple[float, float] | None = None

    def begin(self) -> None:
        """The first frame is there: what the process did before was its start."""
        self._begun = self._begun or (time.monotonic(), time.process_time())

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        """Measure a stage, without those that are timed within it in this thread."""
        within = self._inner.__dict__.setdefault("stack", [])
        within.append([0.0, 0.0])
        wall, cpu = time.perf_counter(), time.thread_time()
        try:
            yield
        finally:
            wall, cpu = time.perf_counter() - wall, time.thread_time() - cpu
            own = within.pop()
            if within:
                within[-1][0] += wall
                within[-1][1] += cpu
            self.runs[stage].append((wall - own[0], cpu - own[1]))

    def wrapped(self, stage: str, work: Callable[..., Any]) -> Callable[..., Any]:
        """The same work, measured."""

        def measured(*inputs: Any, **named: Any) -> Any:
            with self.timed(stage):
                return work(*inputs, **named)

        return measured

    def figures(self) -> dict[str, Any]:
        """What is written down."""
        began, used = self._begun or (time.monotonic(), time.process_time())
        return {
            "seconds": time.monotonic() - began,
            "processor_seconds": time.process_time() - used,
            "stages": self.runs,
        }


def instrument(stages: Stages) -> None:
    """Measure all stages of the nodes of this process."""
    from rclpy.executors import Executor
    from rclpy.publisher import Publisher

    from objreg_ros.bridge.messages import to_msg
    from objreg_ros.bridge.node.accounting import Accounting
    from objreg_ros.bridge.node.node_base import NodeBase
    from objreg_ros.bridge.streams.synchronised_node import SynchronisedNode
    from objreg_ros.registrar import candidate_search
    from objreg_ros.segmenter.second_thread import SecondThread

    for name in CONVERTED:
        setattr(to_msg, name, stages.wrapped("convert", getattr(to_msg, name)))
    _replace(Publisher, "publish", lambda publish: stages.wrapped("publish", publish))
    _replace(Executor, "_take_subscription", lambda take: stages.wrapped("receive", take))
    _replace(SynchronisedNode, "feed", lambda feed: stages.wrapped("match", feed))
    _replace(NodeBase, "_report", lambda report: stages.wrapped("diagnostics", report))
    _replace(SecondThread, "start", lambda start: _in_second_thread(stages, start))
    candidate_search.align = stages.wrapped("register", candidate_search.align)
    Accounting.timed = lambda self, stage: stages.timed(stage)  # type: ignore[method-assign, assignment]
    _measure_waiting(stages, NodeBase, Accounting)


def _measure_waiting(stages: Stages, node: Any, accounting: Any) -> None:
    """How long a frame waits between its arrival and the worker: for its partners, and for the frame before it."""
    arrived: dict[tuple[int, int], float] = {}

    def counted(count: Callable[..., Any]) -> Callable[..., Any]:
        def measured(self: Any, stamp_ns: int) -> None:
            stages.begin()
            arrived[id(self), stamp_ns] = time.perf_counter()
            count(self, stamp_ns)

        return measured

    def worked(work: Callable[..., Any]) -> Callable[..., Any]:
        def measured(self: Any, job: tuple[int, Any]) -> None:
            since = arrived.pop((id(self.accounting), job[0]), None)
            if since is not None:
                stages.runs["waiting"].append((time.perf_counter() - since, 0.0))
            with stages.timed("rest of the work"):
                work(self, job)

        return measured

    _replace(accounting, "count_frame", counted)
    _replace(node, "_work", worked)


def _in_second_thread(stages: Stages, start: Callable[..., Any]) -> Callable[..., Any]:
    return lambda self, work, *inputs: start(self, stages.wrapped("second thread", work), *inputs)


def _replace(owner: Any, name: str, by: Callable[[Callable[..., Any]], Callable[..., Any]]) -> None:
    setattr(owner, name, by(getattr(owner, name)))


def main() -> None:
    """Run a node, then write."""
    name = sys.argv.pop(1)
    stages = Stages()
    instrument(stages)
    try:
        runpy.run_module(MODULES[name], run_name="__main__")
    finally:
        Path(os.environ[FOLDER], f"{name}.json").write_text(json.dumps(stages.figures()))


if __name__ == "__main__":
    main()
