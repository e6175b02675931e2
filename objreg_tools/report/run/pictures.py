# SPDX-License-Identifier: Apache-2.0
"""Pictures of registrations: the two camera pictures, and one laid over the other."""

from __future__ import annotations

import base64
from collections.abc import Callable, Sequence
from typing import Any

import cv2
import numpy as np

from objreg_ros.bridge.camera import colour_frame, lenses
from objreg_ros.bridge.messages import camera_from_msg, from_msg, headers
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import UNTRIED, LoopClosure, Rejected
from objreg_ros.data.images import DepthImage, Detections
from objreg_ros.geometry import back_project, transform
from objreg_ros.segmenter.sensor.organise import organise
from objreg_tools.recording.inputs import Inputs
from objreg_tools.recording.mounts import first_readable, frame_of, frame_tree
from objreg_tools.recording.record import Recording
from objreg_tools.report.run.messages_by_stamp import SLOP_NS, CamerasByStamp, MessagesByStamp
from objreg_tools.report.run.run_summary import RunSummary

WIDTH = 320  # px of one picture
QUALITY = 84  # of a WebP, which every browser shows: two thirds of a JPEG that is as good
KEPT = 64  # images that an album holds at once: 2 MB each of VGA


class Album:
    """The colour and depth of a recording at any time, by the stamps of the messages.

    Pictures with lens distortion are rectified, unless ``rectified``, the segmenter's parameter, says they are already.
    ``on_picture`` is called whenever one was read.
    """

    def __init__(
        self,
        recording: Recording,
        inputs: Inputs,
        rectified: str = "auto",
        on_picture: Callable[[], None] = lambda: None,
    ) -> None:
        self._on_picture = on_picture
        source = inputs.depth or inputs.points
        self._is_cloud = inputs.depth is None
        image = None if self._is_cloud else inputs.image  # a cloud has its colour in it
        self._source, self._image = (MessagesByStamp(recording, topic) if topic else None for topic in (source, image))
        self._cameras, self._of_colour = (
            CamerasByStamp(recording, t) for t in (inputs.camera_info, inputs.colour_info)
        )
        self._raw = lenses.raw_pictures(rectified, source, inputs.image)
        self._named = colour_frame.named_registered(inputs.depth, inputs.image)
        self._find_pose = frame_tree(recording).between
        self._picture_frame = frame_of(first_readable(recording, inputs.image))
        self._of_picture: tuple[Any, lenses.Raw] | None = None  # camera_info of what depth was registered to here
        self._known: dict[int, DepthImage | str] = {}

    def at(self, stamp_ns: int) -> DepthImage | None:
        """The depth image with colour at a time; None where there is none or it cannot be read, see `lacking`."""
        seen = self._seen(stamp_ns)
        return None if isinstance(seen, str) else seen

    def lacking(self, stamp_ns: int) -> str:
        """Why there is no picture at a time, as text; empty where there is one."""
        seen = self._seen(stamp_ns)
        return seen if isinstance(seen, str) else ""

    def rectified(self, detections: Detections) -> Detections:
        """Boxes of the recorded picture at a time, in the picture that `at` gives."""
        self._seen(detections.stamp_ns)
        own = self._cameras.at(detections.stamp_ns), self._raw
        return lenses.detections(detections, *(self._of_picture or own))

    def _seen(self, stamp_ns: int) -> DepthImage | str:
        if stamp_ns not in self._known:
            self._known[stamp_ns] = self._read(stamp_ns)
            self._on_picture()
            if len(self._known) > KEPT:
                del self._known[next(iter(self._known))]
        return self._known[stamp_ns]

    def _read(self, stamp_ns: int) -> DepthImage | str:
        """The depth image with colour, or why there is none."""
        if self._source is None or (self._image is None and not self._is_cloud):
            return "the recording has no colour with depth"
        try:
            depth = self._source.nearest(stamp_ns)
            if depth is None:
                return _nothing_near(self._source, "the stamp")
            colour = None if self._image is None else self._image.nearest(headers.stamp_ns(depth))
            seen = self._depth_image(depth, colour)
        except (ValueError, OSError) as error:
            return f"it cannot be read: {error}"
        if seen.rgb is not None:
            return seen
        if self._image is None:
            return "the cloud has no colour"
        return _nothing_near(self._image, "the depth") if colour is None else "the colour is not of the depth's size"

    def _depth_image(self, depth: Any, colour: Any) -> DepthImage:
        stamp_ns = headers.stamp_ns(depth)
        camera_info = self._cameras.at(stamp_ns)
        if self._is_cloud:
            cloud = colour_frame.in_optical_frame(from_msg.point_cloud(depth), self._picture_frame, self._find_pose)
            return organise(cloud, camera_from_msg.camera_of_cloud(camera_info, cloud))
        if camera_info is None:
            raise ValueError("expected a calibrated camera_info, got none")
        cameras = colour_frame.Cameras(camera_info, self._of_colour.at(stamp_ns), self._named)
        seen = colour_frame.depth_image(
            depth, cameras, colour, self._find_pose, self._raw, colour_frame=self._picture_frame
        )
        self._of_picture = (seen.camera_info, seen.raw) if seen.registered else None
        return seen.depth


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


def chosen_closures(run: RunSummary, most: int = 6) -> list[LoopClosure]:
    """The false ones first, then right ones spread over the run."""
    false = [closure for closure in run.closures if run.is_false(closure)]
    right = [closure for closure in run.closures if not run.is_false(closure)]
    return [*false, *_spread(right, most - len(false))][:most]


def chosen_refusals(run: RunSummary, most: int = 6) -> list[Rejected]:
    """Refusals of candidates that were tried, as many kinds as there are."""
    tried = [refusal for refusal in run.refusals if refusal.reason not in UNTRIED]
    by_reason = [[r for r in tried if r.reason is reason] for reason in dict.fromkeys(r.reason for r in tried)]
    share = -(-most // max(1, len(by_reason)))
    return [refusal for group in by_reason for refusal in _spread(group, share)][:most]


def data_uri(rgb: Array, quality: int = QUALITY) -> str:
    """A picture (H, W, 3) as a WebP inside the page, `WIDTH` wide."""
    height = round(rgb.shape[0] * WIDTH / rgb.shape[1])
    rgb = np.ascontiguousarray(rgb)
    small = rgb if rgb.shape[1] == WIDTH else cv2.resize(rgb, (WIDTH, height), interpolation=cv2.INTER_AREA)
    return picture_uri(small, quality)


def picture_uri(rgb: Array, quality: int = QUALITY) -> str:
    """A picture (H, W, 3) as a WebP inside the page, as large as it is."""
    _, webp = cv2.imencode(".webp", np.ascontiguousarray(rgb[..., ::-1]), [cv2.IMWRITE_WEBP_QUALITY, quality])
    return "data:image/webp;base64," + base64.b64encode(webp.tobytes()).decode("ascii")


def _nothing_near(messages: MessagesByStamp, what: str) -> str:
    passed = f", and {messages.unreadable} messages of it cannot be read" if messages.unreadable else ""
    return f"nothing on {messages.topic} is within {SLOP_NS * 1e-6:.0f} ms of {what}{passed}"


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
