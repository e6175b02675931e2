# SPDX-License-Identifier: Apache-2.0
"""A recording with the odometry and the ground truth that it has on /tf alone, as topics of their own.

So runs, replays and pages take them as they take any odometry and any truth.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import suppress
from typing import Any

import numpy as np
from rosbags.interfaces import Qos

from objreg_ros.bridge.camera.chains import moved, names_of, odometry_edge, truth_edge
from objreg_ros.bridge.camera.frames import FrameEdge, FrameTree
from objreg_ros.bridge.messages import motion_from_msg
from objreg_tools.recording.inputs import TF_ODOM, TF_TRUTH, Inputs, choose_inputs
from objreg_tools.recording.mounts import first_frames, first_readable, frame_of, frame_tree, moving_topics
from objreg_tools.recording.record import Record, Recording, Topic
from objreg_tools.recording.rosbag import messages

UNCERTAIN = np.eye(6)  # /tf has no covariance


class WithTransforms(Recording):
    """The recording ``of``, with the odometry and the truth of its camera by /tf on `TF_ODOM` and `TF_TRUTH`."""

    def __init__(
        self, of: Recording, tree: FrameTree, camera: str, odom: FrameEdge | None, truth: FrameEdge | None
    ) -> None:
        self._of, self._tree, self._camera = of, tree, camera
        self.path, self.kind, self.notes = of.path, of.kind, list(of.notes)
        self.start_ns, self.end_ns = of.start_ns, of.end_ns
        self._edges = {topic: edge for topic, edge in ((TF_ODOM, odom), (TF_TRUTH, truth)) if edge is not None}
        self._moving = moving_topics(of)
        count = sum(of.topics[topic].count for topic in self._moving)
        kinds = {TF_ODOM: "nav_msgs/msg/Odometry", TF_TRUTH: "geometry_msgs/msg/PoseStamped"}
        made = {topic: Topic(topic, kinds[topic], count) for topic in self._edges}
        self.topics = {**of.topics, **made}

    def edge(self, topic: str) -> str:
        """The frames whose motion is on a topic that was made, for the user."""
        return names_of(self._edges[topic])

    def records(
        self, topics: Collection[str] | None = None, start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[Record]:
        """See `Recording.records`; a made record comes behind the /tf that it is made of."""
        wanted = set(self.topics if topics is None else topics)
        made = wanted & self._edges.keys()
        read = (wanted - made) | (set(self._moving) if made else set())
        for record in self._of.records(read, start_ns, end_ns) if read else ():
            if record.topic in wanted:
                yield record
            if made and record.topic in self._moving:
                yield from self._made(record, made)

    def _made(self, record: Record, topics: Collection[str]) -> Iterator[Record]:
        message = record.read()
        for topic in sorted(topics) if message is not None else ():
            for one in moved(message, self._edges[topic]):
                with suppress(ValueError):  # skip an invalid transform
                    yield Record.of(topic, self._message(topic, one), record.stamp_ns)

    def _message(self, topic: str, one: Any) -> Any:
        said, edge = motion_from_msg.odometry(one), self._edges[topic]
        if topic == TF_ODOM:
            return messages.odometry(said.T_odom_body, UNCERTAIN, said.stamp_ns, edge.parent, edge.child)
        T_child_camera = self._tree.between(edge.child, self._camera)
        if T_child_camera is None:
            raise ValueError(f"expected to know where {self._camera!r} sits on {edge.child!r}, got nothing")
        return messages.pose_stamped(said.T_odom_body @ T_child_camera, said.stamp_ns, edge.parent)

    def obstacles(self, shipped_only: bool = True) -> dict[str, str]:
        """See `Recording.obstacles`; what is made has none."""
        return self._of.obstacles(shipped_only)

    def offered_qos(self) -> dict[str, list[Qos]]:
        """See `Recording.offered_qos`."""
        return self._of.offered_qos()

    @property
    def latched(self) -> dict[str, int]:
        """See `Recording.latched`."""
        return self._of.latched

    def close(self) -> None:
        """Let go of the files."""
        self._of.close()


def with_transforms(recording: Recording, outright: bool = False) -> Recording:
    """The recording with the odometry and truth of its camera from /tf; as it is where /tf has neither.

    ``outright``: odometry is wanted of /tf, be it that of a map.
    """
    if not moving_topics(recording):
        return recording
    camera = _camera_of(recording, choose_inputs(recording.topics, frames=first_frames(recording)))
    if not camera:
        return recording
    tree = frame_tree(recording, camera)
    odom, truth = odometry_edge(tree, camera, outright), truth_edge(tree, camera)
    if truth is not None and tree.between(truth.child, camera) is None:
        truth = None
    return recording if odom is truth is None else WithTransforms(recording, tree, camera, odom, truth)


def by_transforms(recording: Recording, inputs: Inputs) -> tuple[str, ...]:
    """The inputs that are taken from /tf, as text for the user."""
    if not isinstance(recording, WithTransforms):
        return ()
    odometry = [f"odometry is that of /tf, {recording.edge(TF_ODOM)}"] if inputs.odom == TF_ODOM else []
    truth = [f"the ground truth is that of /tf, {recording.edge(TF_TRUTH)}"] if inputs.ground_truth == TF_TRUTH else []
    return (*odometry, *truth)


def _camera_of(recording: Recording, inputs: Inputs) -> str:
    """The frame of colour, else of depth; empty if neither names one."""
    topics = inputs.image, inputs.depth, inputs.points
    return next(filter(None, (frame_of(first_readable(recording, topic)) for topic in topics if topic)), "")
