# SPDX-License-Identifier: Apache-2.0
"""The ends of benchmarks/team.py: one in place of a robot's segmenter and odometry, and one beside the registrar.

They and the script share a folder, for they have one machine. A file in it says that a robot's listeners are there,
another when to start, by the clock that never jumps.
"""

from __future__ import annotations

import json
import os
import pickle
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

READY, GO, SPENT, SAVE, SAVED, REPORT = "ready", "go", "spent", "save", "saved", "report.json"
LINGER_S = 2.0  # after the last frame, in which what is late may come
FOLDER = click.Path(exists=True, file_okay=False, path_type=Path)
LATCHED = "labels"  # which the registrar receives too


@click.group()
def main() -> None:
    """One end."""


@main.command()
@click.argument("folder", type=FOLDER)
@click.argument("robot")
def drive(folder: Path, robot: str) -> None:
    """Publish the frames of a robot, as the script has laid them down, each at its moment."""
    import rclpy

    from objreg_ros.bridge.process import profile

    profile.apply()
    rclpy.init(args=[])
    node = rclpy.create_node("segmenter", namespace=robot)
    with Path(folder, f"{robot}.frames").open("rb") as frames:
        names = pickle.load(frames)
        publishers = _publishers(node)
        publishers[LATCHED].publish(names)
        _await(node, lambda: all(p.get_subscription_count() > (t == LATCHED) for t, p in publishers.items()))
        Path(folder, f"{READY}_{robot}").touch()
        _await(node, Path(folder, GO).exists)
        before_s = time.process_time()
        _publish(frames, publishers, float(Path(folder, GO).read_text()))
    Path(folder, f"{SPENT}_{robot}").write_text(str(time.process_time() - before_s))
    time.sleep(LINGER_S)
    rclpy.try_shutdown()


def _publishers(node: Any) -> dict[str, Any]:
    from geometry_msgs.msg import Vector3Stamped
    from nav_msgs.msg import Odometry
    from sensor_msgs.msg import CameraInfo, PointCloud2
    from std_msgs.msg import String

    from objreg_ros.bridge.node import qos

    clouds = {"objects": PointCloud2, "view": PointCloud2}
    kinds = {**clouds, "view/camera_info": CameraInfo, "gravity": Vector3Stamped, "odom": Odometry}
    publishers = {topic: node.create_publisher(kind, topic, qos.stage()) for topic, kind in kinds.items()}
    return {LATCHED: node.create_publisher(String, LATCHED, qos.latched()), **publishers}


def _publish(frames: Any, publishers: dict[str, Any], start_s: float) -> None:
    while True:
        try:
            at_s, messages = pickle.load(frames)
        except EOFError:
            return
        time.sleep(max(0.0, start_s + at_s - time.monotonic()))
        for topic, cdr in messages:
            publishers[topic].publish(cdr)


def _await(node: Any, there: Callable[[], bool]) -> None:
    import rclpy

    while not there():
        rclpy.spin_once(node, timeout_sec=0.05)


@main.command()
@click.argument("folder", type=FOLDER)
def receive(folder: Path) -> None:
    """Write down once a second what nodes report of themselves, until the process is ended.

    And the constraints so far, and for how many keyframes some place was not looked at, for want of time.
    """
    import rclpy
    from diagnostic_msgs.msg import DiagnosticArray
    from nav_msgs.msg import Odometry
    from std_srvs.srv import Trigger

    from objreg_ros.bridge.node import qos
    from objreg_ros.bridge.process import profile

    profile.apply()
    rclpy.init(args=[])
    node = rclpy.create_node("witness")
    latest: dict[str, dict[str, str]] = {}
    closures: list[dict[str, Any]] = []
    hurried: set[int] = set()  # stamps of keyframes
    node.create_subscription(DiagnosticArray, "/diagnostics", lambda message: _note(latest, message), qos.stage(100))
    kept = qos.latched(qos.KEPT_CONSTRAINTS)
    node.create_subscription(Odometry, "constraints", lambda message: closures.append(_closure(message)), kept)
    node.create_subscription(
        DiagnosticArray, "refusals", lambda m: hurried.update(_hurried(m)), qos.stage(qos.REFUSALS)
    )
    saver = node.create_client(Trigger, "registrar/save")
    report = lambda: {"status": latest, "closures": closures, "hurried": len(hurried)}  # noqa: E731
    node.create_timer(1.0, lambda: _write(folder / REPORT, report()))
    _await(node, Path(folder, SAVE).exists)
    done = saver.call_async(Trigger.Request())
    _await(node, done.done)
    Path(folder, SAVED).touch()
    _await(node, lambda: False)


def _note(latest: dict[str, dict[str, str]], message: Any) -> None:
    for status in message.status:
        name, _, what = status.name.strip("/").partition(": ")
        if what == "frames":
            latest[name] = {pair.key: pair.value for pair in status.values}


def _hurried(message: Any) -> set[int]:
    from objreg_ros.bridge.node.diagnostics import refusal_of
    from objreg_ros.data.closures import Reason

    refused = [refusal_of(status) for status in message.status]
    return {rejected.to_ns for rejected in refused if rejected.reason == Reason.OVER_BUDGET}


def _closure(message: Any) -> dict[str, Any]:
    from objreg_ros.bridge.messages import from_msg

    closure = from_msg.loop_closure(message)
    ends = {end: [getattr(closure, f"{end}_frame_id"), getattr(closure, f"{end}_ns")] for end in ("from", "to")}
    return {**ends, "T_from_to": closure.T_from_to.tolist()}


def _write(path: Path, report: Any) -> None:
    """A reader finds the report before or this one, whole."""
    part = path.with_suffix(".part")
    part.write_text(json.dumps(report))
    os.replace(part, path)


if __name__ == "__main__":
    main()
