# SPDX-License-Identifier: Apache-2.0
"""The page of one pair: its pictures, what was matched between them, and why the answer is yes or no."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import DepthImage, Detections
from objreg_ros.geometry import transform
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.prepare.keypoints import KeypointMatches
from objreg_tools.report.live_pictures import sight
from objreg_tools.report.page import environment
from objreg_tools.report.pair.registered_pair import RegisteredPair
from objreg_tools.report.run.pictures import WIDTH, data_uri, overlay, picture_uri
from objreg_tools.report.run.reasons import MEANINGS
from objreg_tools.report.words import reading

SCALE = 2  # times `WIDTH`, of the picture of matches
AGREES_PX = 6.0  # of the first picture at `WIDTH`, within which a pose brings two matched keypoints together
AGREEING, OTHER = (46, 204, 64), (150, 150, 150)  # RGB


class Seen(NamedTuple):
    """The picture of a frame with its depth, and what was detected in it, None where that is not known."""

    image: DepthImage
    detections: Detections | None


def pair_page(name: str, summary: Mapping[str, Any], found: RegisteredPair, seen: Sequence[Seen | None]) -> str:
    """The HTML of a pair of the recording ``name``; a frame without a picture is left out of the drawings."""
    first, second = seen
    pictures = [
        (_picture(one, keyframe), f"{letter}, {(keyframe.stamp_ns - summary['start_ns']) * 1e-9:.3f} s")
        for letter, one, keyframe in zip("AB", seen, (found.first, found.second), strict=True)
        if one is not None
    ]
    matches = None
    if first is not None and second is not None and found.candidate is not None:
        laid = overlay(first.image, second.image, found.candidate.T_target_source)
        pictures.append((data_uri(laid), "B laid over A by the best pose: grey is agreement"))
    if first is not None and second is not None and found.matches is not None:
        T = None if found.candidate is None else found.candidate.T_target_source
        matches = _matches(first.image, second.image, found.matches, T)
    meaning = "" if summary["accepted"] else MEANINGS.get(summary["reason"], "")
    template = environment().get_template("pair.html.j2")
    return template.render(
        name=name, pair=summary, pictures=pictures, matches=matches, meaning=meaning, reading=reading
    )


def _picture(seen: Seen, keyframe: Keyframe) -> str:
    """The picture with its boxes and the points of its objects, drawn at the size at which it is shown."""
    image, found = seen.image, seen.detections
    assert image.rgb is not None  # an album gives no picture without colour
    step = max(1, image.intrinsics.width // WIDTH)
    camera = image.intrinsics.scaled(step)
    size = camera.width, camera.height
    small = cv2.resize(np.ascontiguousarray(image.rgb), size, interpolation=cv2.INTER_AREA)
    boxes = Detections(
        xyxy=np.zeros((0, 4), np.float32) if found is None else found.xyxy / np.float32(step),
        score=np.zeros(0, np.float32) if found is None else found.score,
        label=() if found is None else found.label,
        image_hw=small.shape[:2],
        stamp_ns=image.stamp_ns,
    )
    return data_uri(sight(small, camera, boxes, [item.cloud for item in keyframe.objects]))


def _matches(first: DepthImage, second: DepthImage, matches: KeypointMatches, T_1_2: Array | None) -> dict[str, Any]:
    """Both pictures side by side with a line a match, and how many agree with the pose."""
    small = [_small(image) for image in (first, second)]
    drawn = np.ascontiguousarray(np.hstack(small))
    uv_1 = _pixels(first, matches.target.rays[matches.b])
    uv_2 = _pixels(second, matches.source.rays[matches.a])
    agree = _agree(first, matches, uv_1, T_1_2)
    shift = np.array([small[0].shape[1], 0])
    for k in sorted(range(len(matches)), key=lambda k: bool(agree[k])):
        ends = (tuple(map(int, point)) for point in (uv_1[k], uv_2[k] + shift))
        cv2.line(drawn, *ends, AGREEING if agree[k] else OTHER, 1, cv2.LINE_AA)
    return {"picture": picture_uri(drawn), "count": len(matches), "agreeing": int(agree.sum())}


def _small(image: DepthImage) -> Array:
    assert image.rgb is not None  # an album gives no picture without colour
    width = SCALE * WIDTH // 2
    size = width, round(image.rgb.shape[0] * width / image.rgb.shape[1])
    return np.asarray(cv2.resize(np.ascontiguousarray(image.rgb), size, interpolation=cv2.INTER_AREA))


def _pixels(image: DepthImage, rays: Array) -> Array:
    """Pixels (N, 2) of lines of sight, in the picture as `_small` makes it."""
    camera, scale = image.intrinsics, SCALE * WIDTH / 2 / image.intrinsics.width
    return (rays * (camera.fx, camera.fy) + (camera.cx, camera.cy)) * scale


def _agree(first: DepthImage, matches: KeypointMatches, uv_1: Array, T_1_2: Array | None) -> Array:
    """(N,) bool: which matches a pose brings together in the first picture."""
    if T_1_2 is None or len(matches) == 0:
        return np.zeros(len(matches), bool)
    xyz = transform(T_1_2, matches.source.xyz[matches.a])
    ahead = matches.source.measured[matches.a] & (xyz[:, 2] > 0.1)
    rays = xyz[:, :2] / np.where(ahead, xyz[:, 2], 1.0)[:, None]
    return np.asarray(ahead & (np.linalg.norm(_pixels(first, rays) - uv_1, axis=1) < AGREES_PX))
