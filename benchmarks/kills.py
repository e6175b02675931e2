# SPDX-License-Identifier: Apache-2.0
"""A live registrar with a store, killed by SIGKILL again and again at random moments while frames come.

    python benchmarks/kills.py --kills 1000 --json kills.json

Every frame is a keyframe: the camera drives on between them. A keyframe is announced where its objects came on
`landmarks`; whatever was announced must be in the store after the kill, which must open, and the next start goes on in
it. A store is begun anew after every ``--fresh`` kills. The exit status is 1 where a keyframe was lost, a store did not
open, or a start came to nothing.
"""

from __future__ import annotations

import json
import os
import tempfile
import time
from contextlib import closing
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import click
import numpy as np
from tqdm import tqdm

from objreg_ros.bridge.messages import headers
from objreg_ros.data.frames import Odometry
from objreg_ros.memory.store import Store, StoreError
from objreg_tools.cli.live import private_environment
from objreg_tools.cli.processes import Processes
from objreg_tools.simulation.drawn_place import drawn

SECOND = 1_000_000_000
PERIOD_S, STEP_M = 0.15, 1.0  # between two frames
LATEST_S = 2.0  # after its first announcement a registrar is killed within
START_S = 300.0  # the first one compiles kernels
NAMES = {0: "book", 1: "cup"}


@dataclass
class Count:
    """What came of it."""

    kills: int = 0
    announced: int = 0
    stored: int = 0
    lost: int = 0
    unreadable: list[str] = field(default_factory=list)
    silent: int = 0


class Robot:
    """Publishes frames of a camera that drives on, and receives which keyframes are announced."""

    def __init__(self) -> None:
        import rclpy
        from sensor_msgs.msg import PointCloud2

        from objreg_ros.bridge.messages import to_msg
        from objreg_ros.bridge.node import qos

        rclpy.init(args=[])
        self._node = rclpy.create_node("robot")
        self._publishers: dict[str, Any] = {}
        self._number, self._next_s = 0, 0.0
        self.announced: set[int] = set()
        self._spin = rclpy.spin_once
        self._node.create_subscription(
            PointCloud2, "landmarks", lambda m: self.announced.add(headers.stamp_ns(m)), qos.stage(depth=1000)
        )
        self._send("labels", to_msg.labels(NAMES), qos.latched())

    def go_on(self) -> None:
        """Publish the next frame if it is due, and receive what came meanwhile."""
        from objreg_ros.bridge.messages import to_msg

        if time.monotonic() >= self._next_s:
            self._next_s = time.monotonic() + PERIOD_S
            self._number += 1
            T = np.eye(4)
            T[0, 3] = STEP_M * self._number
            seen = replace(drawn(self._number * SECOND), T_odom_camera=T)
            pose = Odometry(T_odom_body=T, stamp_ns=seen.stamp_ns, child_frame_id=seen.frame_id)
            for topic, message in {
                "odom": to_msg.odometry(pose),
                "view": to_msg.view(seen),
                "view/camera_info": to_msg.view_camera_info(seen),
                "gravity": to_msg.gravity(seen),
                "objects": to_msg.objects(seen, NAMES),
            }.items():
                self._send(topic, message)
        self._spin(self._node, timeout_sec=0.01)

    def _send(self, topic: str, message: Any, profile: Any = None) -> None:
        from objreg_ros.bridge.node import qos

        if topic not in self._publishers:
            self._publishers[topic] = self._node.create_publisher(type(message), topic, profile or qos.stage())
        self._publishers[topic].publish(message)


def kill_once(robot: Robot, folder: Path, store: Path, moment_s: float, count: Count) -> None:
    """Start a registrar, kill it so long after it announced its first keyframe, and look into the store."""
    robot.announced.clear()
    arguments = ["--ros-args", "-p", f"store:={store}", "-p", "T_base_camera:=[0.0,0.0,0.0,0.0,0.0,0.0,1.0]"]
    with Processes(folder, os.environ) as processes:
        registrar = processes.start("registrar", "objreg_ros.registrar.node", [*arguments, "-p", "reliable:=true"])
        deadline = time.monotonic() + START_S
        while not robot.announced and registrar.poll() is None and time.monotonic() < deadline:
            robot.go_on()
        count.silent += not robot.announced
        until = time.monotonic() + moment_s
        while time.monotonic() < until:
            robot.go_on()
        registrar.kill()
        registrar.wait()
    for _ in range(20):  # what was on its way
        robot.go_on()
    count.kills += 1
    count.announced += len(robot.announced)
    try:
        with closing(Store(store, read_only=True)) as opened:
            stamps = {opened.keyframe(number).stamp_ns for number in opened.keyframe_ids()[-100:]}
    except StoreError as error:
        count.unreadable.append(str(error))
        return
    count.stored = max(count.stored, len(stamps))
    count.lost += len(robot.announced - stamps)


@click.command(help=__doc__)
@click.option("--kills", type=click.IntRange(min=1), default=100, show_default=True)
@click.option("--fresh", type=click.IntRange(min=1), default=100, show_default=True, help="Kills of one store.")
@click.option("--seed", type=int, default=0, show_default=True, help="Of the moments.")
@click.option("--json", "json_file", type=click.Path(dir_okay=False, path_type=Path), help="Write figures here.")
def main(kills: int, fresh: int, seed: int, json_file: Path | None) -> None:
    os.environ.update(private_environment())
    rng, count, robot = np.random.default_rng(seed), Count(), Robot()
    with tempfile.TemporaryDirectory(prefix="objreg_kills_") as folder:
        for number in tqdm(range(kills), unit="kill"):
            store = Path(folder, f"{number // fresh}.db")
            kill_once(robot, Path(folder), store, float(rng.uniform(0.0, LATEST_S)), count)
    click.echo(
        f"{count.kills} kills: {count.announced} keyframes announced, {count.lost} of them lost, "
        f"{len(count.unreadable)} stores unreadable, {count.silent} starts without a keyframe"
    )
    if json_file is not None:
        json_file.write_text(json.dumps(asdict(count), indent=1))
    raise SystemExit(bool(count.lost or count.unreadable or count.silent))


if __name__ == "__main__":
    main()
