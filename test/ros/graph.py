# SPDX-License-Identifier: Apache-2.0
"""Node processes of this package on a ROS domain of their own, and a listener that speaks to them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import Header

from objreg_ros.bridge.messages import headers
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.accounting import Balance
from objreg_ros.bridge.node.common import CONNECTED
from objreg_ros.bridge.node.diagnostics import balance_of
from objreg_ros.bridge.process import profile

START_S = 120.0  # on a machine that may be busy
ANSWER_S = 60.0
REPOSITORY = Path(__file__).resolve().parents[2]


class Graph:
    """Starts nodes, publishes to them and waits for what they say. Frames are answered one by one: nothing is lost."""

    def __init__(self, domain: int, folder: Path) -> None:
        self.domain, self.folder = domain, folder
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
        profile.apply()
        self.context = Context()
        self.context.init(domain_id=domain)
        self.node = Node("listener", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.publishers: dict[str, Any] = {}
        self.received: defaultdict[str, list[Any]] = defaultdict(list)
        self.counters: dict[str, Balance] = {}
        self.connected: dict[str, dict[str, int]] = {}
        self.status: dict[str, DiagnosticStatus] = {}  # of each node, the last
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._take_status, qos.stage())

    # Processes

    def command(self, stage: str, *ros_args: str) -> list[str]:
        arguments = [word for pair in ros_args for word in pair.split(" ", 1)]
        module = "objreg_mapper.node" if stage == "mapper" else f"objreg_ros.{stage}.node"
        return [sys.executable, "-m", module, "--ros-args", *arguments]

    def environment(self) -> dict[str, str]:
        path = os.pathsep.join(filter(None, (str(REPOSITORY), os.environ.get("PYTHONPATH"))))
        return {**os.environ, "ROS_DOMAIN_ID": str(self.domain), "PYTHONPATH": path}

    def start(self, name: str, stage: str, *ros_args: str) -> None:
        """Start a node as a process; its output goes to `log`."""
        self._start(name, self.command(stage, *ros_args))

    def start_module(self, name: str, module: str, *ros_args: str) -> None:
        """Start a module that is a node, as an adapter's."""
        arguments = [word for pair in ros_args for word in pair.split(" ", 1)]
        self._start(name, [sys.executable, "-m", module, "--ros-args", *arguments])

    def start_composed(self, *arguments: str) -> None:
        """Start all nodes in one process, called ``graph``."""
        self._start("graph", [sys.executable, "-m", "objreg_tools.graph", *arguments])

    def _start(self, name: str, command: list[str]) -> None:
        with self._log(name).open("wb") as log:
            self.processes[name] = subprocess.Popen(
                command, env=self.environment(), stdout=log, stderr=log, cwd=self.folder
            )

    def log(self, name: str) -> str:
        return self._log(name).read_text()

    def _log(self, name: str) -> Path:
        return self.folder / f"{name.replace('/', '_')}.log"

    def alive(self, name: str) -> bool:
        return self.processes[name].poll() is None

    def stop(self, name: str, how: signal.Signals = signal.SIGINT) -> int:
        """End a node as a user would; its exit status."""
        process = self.processes.pop(name)
        process.send_signal(how)
        try:
            return process.wait(ANSWER_S)
        finally:
            process.kill()

    def close(self) -> None:
        for name in list(self.processes):
            self.stop(name, signal.SIGKILL)
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()

    # Messages

    def wait_for(self, true: Callable[[], bool], seconds: float = ANSWER_S, what: str = "") -> None:
        """Let messages come in until something is true; an AssertionError with the logs if it does not become so."""
        deadline = time.monotonic() + seconds
        while not true():
            assert time.monotonic() < deadline, f"waited {seconds} s for {what}\n{self._logs()}"
            assert all(map(self.alive, self.processes)), f"a node ended while waiting for {what}\n{self._logs()}"
            self.executor.spin_once(timeout_sec=0.05)

    def receive(self, kind: type, topic: str, profile: Any = None) -> None:
        """Collect the messages of a topic in ``received``."""
        self.node.create_subscription(kind, topic, self.received[topic].append, profile or qos.stage(depth=1000))

    def publish(self, topic: str, message: Any, listeners: int = 1) -> None:
        """Publish once the nodes listen: each end of a connection has to know of the other."""
        if topic not in self.publishers:
            reliable = qos.latched() if topic.endswith(("labels", "label_info", "constraints")) else qos.stage()
            publisher = self.publishers[topic] = self.node.create_publisher(type(message), topic, reliable)

            def there() -> bool:
                received_by = sum(known.get(publisher.topic_name, 0) for known in self.connected.values())
                return min(received_by, publisher.get_subscription_count()) >= listeners

            self.wait_for(there, START_S, f"{listeners} nodes that are connected to {topic}")
        self.publishers[topic].publish(message)

    def answer(self, node: str, stamp_ns: int, topic: str = "finished") -> str:
        """What became of a frame at a node: "published", or "dropped <reason>"."""
        found: list[Header] = []

        def there() -> bool:
            found[:] = [m for m in self.received[topic] if self._is_of(m, node, stamp_ns)]
            return bool(found)

        self.wait_for(there, what=f"{node} to finish {stamp_ns} ns")
        return found[-1].frame_id.removeprefix(f"{node} ")

    @staticmethod
    def _is_of(message: Header, node: str, stamp_ns: int) -> bool:
        of_node = message.frame_id.startswith(f"{node} ") and headers.stamp_ns(message) == stamp_ns
        return of_node and message.frame_id != f"{node} followed"  # whose end is yet to come

    def balance(self, name: str, received: int) -> Balance:
        """The counters of a node once it has reported that it received so many."""
        self.wait_for(
            lambda: (
                name in self.counters and self.counters[name].received == received and not self.counters[name].waiting
            ),
            what=f"{name} to report {received} frames, got {self.counters.get(name)}",
        )
        return self.counters[name]

    def _take_status(self, message: DiagnosticArray) -> None:
        for status in message.status:
            name = status.name.removesuffix(": frames")
            self.status[name] = status
            self.counters[name], self.connected[name] = balance_of(status), _connected_of(status)

    def _logs(self) -> str:
        return "\n".join(f"--- {name}\n{self.log(name)}" for name in self.processes)


def _connected_of(status: DiagnosticStatus) -> dict[str, int]:
    """Full topic name → the publishers that a node is connected to, as its status states."""
    pairs = ((pair.key, pair.value) for pair in status.values if pair.key.startswith(CONNECTED))
    return {key.removeprefix(CONNECTED): int(value) for key, value in pairs}
