# SPDX-License-Identifier: Apache-2.0
"""Pictures of registrations: what the two moments saw, and the one laid over the other."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from typing import Any

import cv2
import numpy as np

from objreg_ros.bridge import from_msg
from objreg_ros.data import UNTRIED, Array, DepthImage, LoopClosure, Rejected
from objreg_ros.geometry import back_project, transform
from objreg_ros.recording.inputs import Inputs
from objreg_ros.recording.record import Record, Recording
from objreg_ros.report.story import Story
from objreg_ros.segmenter.organise import organise

WINDOW_NS = 150_000_000  # how far from a moment its pictures may have been recorded
WIDTH = 320  # px of one picture
QUALITY = 82


class Album:
    """The colour and depth of a recording at any moment."""

    def __init__(self, recording: Recording, inputs: Inputs) -> None:
        self._recording, self._inputs = recording, inputs
        self._known: dict[int, DepthImage | None] = {}
        info = () if inputs.camera_info is None else recording.records([inputs.camera_info])
        self._camera_info = next((message for record in info if (message := record.read()) is not None), None)

    def at(self, stamp_ns: int) -> DepthImage | None:
        """The depth image with colour at a moment; None where the recording has none with colour."""
        if stamp_ns not in self._known:
            self._known[stamp_ns] = self._read(stamp_ns)
        return self._known[stamp_ns]

    def _read(self, stamp_ns: int) -> DepthImage | None:
        source = self._inputs.depth or self._inputs.points
        topics = [topic for topic in (self._inputs.image, source) if topic]
        near = list(self._recording.records(topics, stamp_ns - WINDOW_NS, stamp_ns + WINDOW_NS))
        depth = _nearest((r for r in near if r.topic == source), stamp_ns)
        colour = _nearest((r for r in near if r.topic == self._inputs.image), stamp_ns)
        if depth is None:
            return None
        seen = self._depth_image(depth, colour)
        return seen if seen.rgb is not None else None

    def _depth_image(self, depth: Any, colour: Any) -> DepthImage:
        if self._inputs.depth is None:
            cloud = from_msg.point_cloud(depth)
            return organise(cloud, from_msg.camera_of_cloud(self._camera_info, cloud))
        return from_msg.depth_image(depth, self._camera_info, colour)


def overlay(target: DepthImage, source: DepthImage, T_target_source: Array) -> Array:
    """(H, W, 3) RGB at `WIDTH`: the target in green and, where it was seen, the source over it in magenta.

    Grey is agreement; coloured fringes are not.
    """
    step = max(1, target.intrinsics.width // WIDTH)
    ground = _grey(target)[step // 2 :: step, step // 2 :: step]
    seen = np.zeros_like(ground)
    mask = np.zeros(ground.shape, bool)
    uv, values = _projected(source, T_target_source, target, step)
    seen[uv[:, 1], uv[:, 0]] = values
    mask[uv[:, 1], uv[:, 0]] = True
    mask = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8)).astype(bool)
    seen = np.where(mask & (seen == 0), cv2.dilate(seen, np.ones((3, 3), np.uint8)), seen)
    faint = (0.35 * ground).astype(np.uint8)
    return np.dstack([np.where(mask, seen, faint), np.where(mask, ground, faint), np.where(mask, seen, faint)])


def chosen_closures(story: Story, most: int = 6) -> list[LoopClosure]:
    """The false ones first, then right ones spread over the run."""
    false = [closure for closure in story.closures if story.is_false(closure)]
    right = [closure for closure in story.closures if not story.is_false(closure)]
    return [*false, *_spread(right, most - len(false))][:most]


def chosen_refusals(story: Story, most: int = 6) -> list[Rejected]:
    """Refusals of something that was tried, as many kinds as there are."""
    tried = [refusal for refusal in story.refusals if refusal.reason not in UNTRIED]
    by_reason = [[r for r in tried if r.reason is reason] for reason in dict.fromkeys(r.reason for r in tried)]
    share = -(-most // max(1, len(by_reason)))
    return [refusal for group in by_reason for refusal in _spread(group, share)][:most]


def data_uri(rgb: Array) -> str:
    """A picture (H, W, 3) as a JPEG inside the page, `WIDTH` wide."""
    height = round(rgb.shape[0] * WIDTH / rgb.shape[1])
    small = rgb if rgb.shape[1] == WIDTH else cv2.resize(rgb, (WIDTH, height), interpolation=cv2.INTER_AREA)
    _, jpeg = cv2.imencode(".jpg", small[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    return "data:image/jpeg;base64," + base64.b64encode(jpeg.tobytes()).decode("ascii")


def _nearest(records: Iterable[Record], stamp_ns: int) -> Any:
    messages = (record.read() for record in records)
    return min((m for m in messages if m is not None), key=lambda m: abs(from_msg.stamp_ns(m) - stamp_ns), default=None)


def _grey(image: DepthImage) -> Array:
    if image.rgb is None:
        raise ValueError("expected a picture with colour, got one without")
    return cv2.cvtColor(np.ascontiguousarray(image.rgb), cv2.COLOR_RGB2GRAY)


def _projected(source: DepthImage, T_target_source: Array, target: DepthImage, step: int) -> tuple[Array, Array]:
    """Pixels (N, 2) of the target at ``1 / step`` of its size and the grey of the source there, the nearest last."""
    camera = source.intrinsics
    xyz = back_project(source.depth, camera.fx, camera.fy, camera.cx, camera.cy)
    measured = source.depth > 0
    points = transform(T_target_source, xyz[measured])
    values = _grey(source)[measured]
    ahead = points[:, 2] > 0.1
    points, values = points[ahead], values[ahead]
    order = np.argsort(-points[:, 2])
    points, values = points[order], np.maximum(values[order], 1)
    view = target.intrinsics.scaled(step)
    u = np.rint(view.fx * points[:, 0] / points[:, 2] + view.cx).astype(int)
    v = np.rint(view.fy * points[:, 1] / points[:, 2] + view.cy).astype(int)
    inside = (u >= 0) & (u < view.width) & (v >= 0) & (v < view.height)
    return np.column_stack([u, v])[inside], values[inside]


def _spread(items: Sequence[Any], count: int) -> list[Any]:
    """So many items, evenly over the sequence."""
    if count <= 0 or not items:
        return []
    places = np.unique(np.linspace(0, len(items) - 1, min(count, len(items))).round().astype(int))
    return [items[place] for place in places]
