# SPDX-License-Identifier: Apache-2.0
"""How a registrar receives keyframers elsewhere: those of each camera of each robot on a topic of their own."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

from sensor_msgs.msg import CompressedImage
from std_msgs.msg import String

from objreg_ros.bridge.messages import headers
from objreg_ros.bridge.messages.keyframes_msg import SentKeyframe, read_keyframe
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.streams.frames_in import FramesNode
from objreg_ros.bridge.streams.key import Key
from objreg_ros.data.closures import framed


class FromRobot(NamedTuple):
    """A keyframe that a robot sent."""

    robot: str
    sent: SentKeyframe

    @property
    def stamp_ns(self) -> int:
        """When it was seen."""
        return self.sent.stamp_ns

    @property
    def nbytes(self) -> int:
        """The memory that it takes while it waits."""
        return len(self.sent.packed)


class KeyframesIn:
    """The counters of ``node`` count keyframes; ``take`` is given each that may come in.

    ``prefixes`` has what stands before the topics of each robot, ``cameras`` the namespaces of each one's keyframers
    behind that; none where it has one, in its own. The frames distinguish two cameras of a robot: of two with the same
    frame, the first to come is taken. The topic's namespace names the robot, and with a ``key`` it signed that.
    """

    def __init__(
        self,
        node: FramesNode,
        prefixes: Mapping[str, str],
        cameras: Sequence[Sequence[str]],
        take: Callable[[FromRobot], None],
        key: Key | None = None,
    ) -> None:
        self._node, self._take, self._key = node, take, key or Key()
        self.counts = Counter[tuple[str, str]]()  # by robot, and what became of its keyframes
        self._frames = dict[tuple[str, str], str]()  # of the camera of each robot and topic
        for (robot, prefix), names in zip(prefixes.items(), cameras, strict=True):
            for camera in (f"{name}/" for name in names) if names else ("",):
                self._listen(robot, f"{prefix}{camera}")

    def _listen(self, robot: str, prefix: str) -> None:
        """Receive the keyframer of this namespace, and what its detector's numbers are called."""
        topic, kept = f"{prefix}keyframes", qos.latched(qos.KEPT_KEYFRAMES)
        self._node.listen(String, f"{prefix}labels", partial(self._node.receive_labels, robot=robot), qos.latched())
        self._node.listen(CompressedImage, topic, partial(self._receive, robot, topic), kept, watched=topic)
        self._node.expect(topic, topic)

    def _receive(self, robot: str, topic: str, message: Any) -> None:
        full, stamp_ns = self._node.resolve_topic_name(topic), headers.stamp_ns(message)
        sent = self._node.read_aside("keyframes", lambda one: read_keyframe(self._key.check(full, one)), message)
        self._node.accept(stamp_ns)
        if sent is None:
            self._node.drop(stamp_ns, "malformed_keyframes")
        elif (other := self._other(robot, topic, sent.frame_id)) is not None:
            expected = f"expected each camera of a robot with a frame of its own, got {sent.frame_id!r} on {topic}"
            self._node.drop(stamp_ns, "same_camera", f"{expected} and on {other}; name their frames apart")
        elif self._node.let_in(stamp_ns):
            self.count(robot, "received")
            self._take(FromRobot(robot, sent))

    def _other(self, robot: str, topic: str, frame_id: str) -> str | None:
        """The topic of another camera of the robot that has this frame; None where it is its own."""
        framed_id = framed(robot, frame_id)
        for (whose, other), taken in self._frames.items():
            if whose == robot and other != topic and taken == framed_id:
                return other
        self._frames[robot, topic] = framed_id
        return None

    def count(self, robot: str, what: str) -> None:
        """One more keyframe of a robot of which this became."""
        self.counts[robot, what] += 1
