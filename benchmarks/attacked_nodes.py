# SPDX-License-Identifier: Apache-2.0
"""The live nodes under attack: each in a process of its own, in a namespace of its own.

Batches of spoilt messages are published on every topic that a node listens to, with good ones among them. After each
batch a good frame must come through within seconds, the process must live, and in the end its counters must balance. A
trial is a message; the seed of a batch is that of its dice.
"""

from __future__ import annotations

import os
import random
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import attacked_messages as good
from attacked_files import borrowed
from trials import GREED_MB, NoTrialError, Tally

from objreg_ros.bridge.messages import to_msg
from objreg_ros.bridge.messages.headers import stamp_ns as stamp_of
from objreg_ros.geometry import back_project

SHARES = {"detector": 1.0, "segmenter": 1.0, "registrar": 1.0, "mapper": 0.7, "keyframer": 0.7}  # of the time
BATCH = 40
THROUGH_S = 30.0  # within which a good frame comes through again, on a machine that is busy
PACE_S = 0.01
START_S = 120.0
STEP_NS = good.SECOND // 10
GOOD = 0.3  # of the frames in a batch


@dataclass(frozen=True)
class Inputs:
    """What a node is sent: the messages of one frame by topic, the first of them being the frame."""

    frame: Callable[[int], dict[str, Any]]
    before: Callable[[], dict[str, Any]]  # once
    package: str = ""  # whose node it is, where that has another name


def _detector(stamp_ns: int) -> dict[str, Any]:
    return {"image": to_msg.image(good.colour_image(stamp_ns))}


def _segmenter(stamp_ns: int) -> dict[str, Any]:
    image, camera = good.depth_image(stamp_ns), good.SMALL
    xyz = back_project(image.depth, camera.fx, camera.fy, camera.cx, camera.cy).astype("f4")
    cloud = to_msg.points(good.PointCloud(xyz=xyz, rgb=image.rgb, stamp_ns=stamp_ns))
    table = to_msg.detections_table(good.two_detections(stamp_ns), good.NAMES)
    return {"points": cloud, "detections_table": table, "camera_info": to_msg.camera_info(camera, stamp_ns, "camera")}


def _registrar(stamp_ns: int) -> dict[str, Any]:
    objects, view, info, gravity, _ = good.frame_messages(good.drawn_frame(stamp_ns))
    said = {"objects": objects, "view": view, "view/camera_info": info, "gravity": gravity}
    return {**said, "odom": good.odometry_message(stamp_ns, (stamp_ns / good.SECOND) % 100)}


def _mapper(stamp_ns: int) -> dict[str, Any]:
    x = (stamp_ns / good.SECOND) % 100
    tie = good.constraint_message(stamp_ns - 2 * STEP_NS, stamp_ns, x=0.2)
    return {"constraints": tie, "odom": good.odometry_message(stamp_ns, x)}


def _labels() -> dict[str, Any]:
    return {"labels": to_msg.labels(good.NAMES)}


STAGES = {
    "detector": Inputs(_detector, dict),
    "segmenter": Inputs(_segmenter, _labels),
    "registrar": Inputs(_registrar, _labels),
    "mapper": Inputs(_mapper, dict),
    "keyframer": Inputs(_registrar, _labels, "keyframes"),
}


def run_live(target: str, seconds: float, first: int) -> Tally:
    """Attack a live node for so long, in one batch at least; the first batch is that of seed ``first``."""
    kind, stage = target.split(" ")
    return besieged(SIEGES[kind], stage, seconds, first)


def besieged(siege: type[Siege], stage: str, seconds: float, first: int) -> Tally:
    """What comes of the batches of one siege."""
    with tempfile.TemporaryDirectory() as name, closing(siege(stage, Path(name))) as live:
        began, seed = time.monotonic(), first
        try:
            while seed == first or time.monotonic() - began < seconds:
                live.batch(seed)
                seed += 1
            live.settle(seed)
        except AssertionError as error:  # the node that should follow the one that ended does not begin
            live.tally.find(seed, "death", str(error).splitlines()[0][:200], "")
        return live.tally


class Siege:
    """One node, and what it is sent."""

    DOMAIN = 48

    def __init__(self, stage: str, folder: Path) -> None:
        from std_msgs.msg import Header

        self.name, self.inputs, self.tally, self.folder = stage, STAGES[stage], Tally(), folder
        self.graph = borrowed("ros/graph.py").Graph(self.DOMAIN + list(STAGES).index(stage), folder)
        self.graph.receive(Header, "/finished")
        self._options = ["-p reliable:=true", *self.options()]
        if stage == "detector":
            tiny = borrowed("detector/tiny_model.py")
            (folder / "labelmap.txt").write_text("cup\ntv\n")
            boxes = tiny.tf_outputs([[0.3, 0.3, 0.7, 0.7]], [0], [0.9])
            self._options.append(f"-p model:={tiny.save_constant_model(folder / 'tiny.onnx', boxes)}")
        self._now_ns = 10 * good.SECOND
        self._start()

    def _start(self) -> None:
        """Start the node and see a good frame through."""
        self.graph.start(f"/{self.name}", self.inputs.package or self.name, *self._options)
        for topic, message in {**self.inputs.before(), **self.inputs.frame(self._now_ns)}.items():
            self._connect(topic, message)
        self._sees_good(START_S)
        self._began_mb = _peak_mb(self.pid)

    def options(self) -> Sequence[str]:
        """More arguments of the node."""
        return ()

    @property
    def pid(self) -> int:
        """Of the node's process."""
        return int(self.graph.processes[f"/{self.name}"].pid)

    def _connect(self, topic: str, message: Any) -> None:
        """Wait until the node listens to a topic."""
        from objreg_ros.bridge.node import qos

        if topic not in self.graph.publishers:
            profile = qos.latched() if topic in ("labels", "constraints") else qos.stage()
            self.graph.publishers[topic] = self.graph.node.create_publisher(type(message), topic, profile)
        publisher = self.graph.publishers[topic]
        self.graph.wait_for(lambda: publisher.get_subscription_count() > 0, START_S, f"{self.name} on {topic}")

    def close(self) -> None:
        """End everything."""
        self.graph.close()

    def batch(self, seed: int) -> None:
        """Publish a batch and see what became of the node."""
        draw = random.Random(seed)
        self._attack(draw, seed)
        if not self._alive():
            self._bury(seed)
        elif not self._sees_good(THROUGH_S):
            kind = "hang" if self._alive() else "death"
            self.tally.find(seed, kind, f"no good frame within {THROUGH_S:.0f} s", self._last_line())
            self._restart()
        elif (grown := _peak_mb(self.pid) - self._began_mb) > GREED_MB:
            self.tally.find(seed, "greed", f"{grown:.0f} MB", "")
            self._restart()

    def _attack(self, draw: random.Random, seed: int) -> None:
        """What is done in one batch."""
        for _ in range(BATCH):
            self._send_one(draw)
            self.graph.executor.spin_once(timeout_sec=PACE_S)

    def _send_one(self, draw: random.Random) -> None:
        """One frame: whole, or with some of its messages spoilt, lost or of another time."""
        self._now_ns += STEP_NS
        messages = {**self.inputs.frame(self._now_ns), **(self.inputs.before() if draw.random() < 0.1 else {})}
        spoil = draw.random() > GOOD
        for topic, message in messages.items():
            if spoil and draw.random() < 0.6:
                try:
                    with _quiet():
                        message = _of_the_time(draw, good.spoilt(draw, message), message)
                except NoTrialError:
                    continue
                self.tally.tries += 1
            self._publish(topic, message)

    def _publish(self, topic: str, message: Any) -> None:
        if topic in self.graph.publishers:
            self.graph.publishers[topic].publish(message)

    def _sees_good(self, seconds: float) -> bool:
        """Whether a good frame is published within so long; frames come at the rate of a camera."""
        until = time.monotonic() + seconds
        stamps: set[int] = set()
        for topic, message in self.inputs.before().items():
            self._publish(topic, message)
        while time.monotonic() < until and self._alive():
            self._now_ns += STEP_NS
            stamps.add(self._now_ns)
            for topic, message in self.inputs.frame(self._now_ns).items():
                self._publish(topic, message)
            for _ in range(5):
                self.graph.executor.spin_once(timeout_sec=0.02)
            finished = self.graph.received["/finished"]
            if any(m.frame_id == f"{self.name} published" and stamp_of(m) in stamps for m in finished):
                finished.clear()
                return True
        return False

    def settle(self, seed: int) -> None:
        """The counters of the node balance: received = published + waiting + dropped."""
        node = f"/{self.name}"
        self.graph.counters.pop(node, None)
        until = time.monotonic() + THROUGH_S
        while node not in self.graph.counters and time.monotonic() < until and self._alive():
            self.graph.executor.spin_once(timeout_sec=0.1)
        counters = self.graph.counters.get(node)
        if counters is None:
            self.tally.find(seed - 1, "hang", "no counters on /diagnostics", self._last_line())
        elif counters.received != counters.published + counters.waiting + sum(counters.dropped.values()):
            self.tally.find(seed - 1, "wrong", f"the counters do not balance: {replace(counters, stage_ms={})}", "")
        else:
            self.tally.refused += sum(counters.dropped.values())

    def _alive(self) -> bool:
        return bool(self.graph.alive(f"/{self.name}"))

    def _bury(self, seed: int) -> None:
        status = self.graph.processes[f"/{self.name}"].poll()
        self.tally.find(seed, "death", f"exit status {status}", self._last_line())
        self._restart()

    def _restart(self) -> None:
        self.graph.stop(f"/{self.name}", 9)
        self._start()

    def _last_line(self) -> str:
        lines = [line for line in self.graph.log(f"/{self.name}").splitlines() if line.strip()]
        return lines[-1][:200] if lines else ""


@contextmanager
def _quiet() -> Iterator[None]:
    """What the transport says of bytes that are no message is not for this terminal."""
    kept = os.dup(2)
    with Path(os.devnull).open("w") as nothing:
        os.dup2(nothing.fileno(), 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


def _of_the_time(draw: random.Random, message: Any, original: Any) -> Any:
    """Mostly the stamp that was meant: else the synchroniser would see next to nothing of what was spoilt."""
    if hasattr(message, "header") and draw.random() < 0.9:
        message = good.from_shell(message)
        message.header = good.from_msg_copy(message.header)
        message.header.stamp = original.header.stamp
    return message


def _peak_mb(pid: int) -> float:
    """The most memory that a process has had so far; 0 where it has ended."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return 0.0
    return next((int(line.split()[1]) / 1024 for line in lines if line.startswith("VmHWM")), 0.0)


SIEGES: dict[str, type[Siege]] = {"live": Siege}
TARGETS = {f"live {stage}": share for stage, share in SHARES.items()}
