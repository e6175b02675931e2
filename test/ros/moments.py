# SPDX-License-Identifier: Apache-2.0
"""What a camera sends, frame by frame: a real recording where it is at hand, a drawn one otherwise."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from objreg_ros.bridge.messages import from_msg, to_msg
from objreg_ros.data.images import ColourImage, DepthImage, Intrinsics
from objreg_tools.recording.inputs import GRAPH_TOPICS, choose_inputs
from objreg_tools.recording.opening import open_recording

CAMERA = Intrinsics(fx=262.5, fy=262.5, cx=159.5, cy=119.5, width=320, height=240)
SECOND = 1_000_000_000


@dataclass
class Moment:
    """The messages of one stamp by the topic that the nodes listen to."""

    stamp_ns: int
    messages: dict[str, Any] = field(default_factory=dict)


def recorded(path: Path, count: int, step: int) -> list[Moment]:
    """Every ``step``-th moment of a recording, ``count`` of them."""
    with open_recording(path) as recording:
        topics = {topic: GRAPH_TOPICS[name] for name, topic in choose_inputs(recording.topics).chosen().items()}
        wanted = {topic: graph for topic, graph in topics.items() if graph in ("image", "depth/image", "camera_info")}
        records = recording.records(wanted)
        groups = (list(group) for _, group in groupby(records, key=lambda record: record.stamp_ns))
        kept = [group for k, group in enumerate(groups) if k % step == 0 and k < count * step]
        return [_moment([(wanted[record.topic], record.message) for record in group]) for group in kept]


def _moment(messages: list[tuple[str, Any]]) -> Moment:
    """The contents of recorded messages, written again with rclpy's classes."""
    said = dict(messages)
    colour = from_msg.image(said["image"])
    depth = from_msg.depth_image(said["depth/image"], said["camera_info"])
    return moment(colour, depth)


def moment(colour: ColourImage, depth: DepthImage) -> Moment:
    """One frame of a camera."""
    where = (depth.stamp_ns, depth.frame_id)
    messages = {
        "camera_info": to_msg.camera_info(depth.intrinsics, *where),
        "image": to_msg.image(colour),
        "depth/image": to_msg.depth_image(depth),
    }
    return Moment(depth.stamp_ns, messages)


def drawn(count: int) -> Iterator[Moment]:
    """A camera that looks down on a table with a box, over and over."""
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width]
    depth = (1.4 - 0.3 * v / CAMERA.height).astype(np.float32)
    depth[90:150, 120:200] -= 0.15
    rgb = np.repeat(((u * 7 + v * 13) % 256).astype(np.uint8)[..., None], 3, axis=-1)
    for stamp_ns in range(SECOND, SECOND + count * SECOND // 10, SECOND // 10):
        yield moment(
            ColourImage(rgb=rgb, stamp_ns=stamp_ns),
            DepthImage(depth=depth, rgb=None, intrinsics=CAMERA, stamp_ns=stamp_ns),
        )
