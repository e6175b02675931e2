# SPDX-License-Identifier: Apache-2.0
"""What is odd about a frame that breaks no contract."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.data.images import DepthImage, Detections
from objreg_ros.segmenter.params import SegmenterParams
from objreg_ros.segmenter.sensor.doubts import range_doubt, registration_doubt
from objreg_ros.segmenter.sensor.view import reduced_view
from segmenter.scenes import CAMERA

PARAMS = SegmenterParams()


def of(depth: np.ndarray, frame_id: str = "") -> DepthImage:
    return DepthImage(depth=depth.astype(np.float32), rgb=None, intrinsics=CAMERA, stamp_ns=0, frame_id=frame_id)


def doubt_of_range(depth: np.ndarray, params: SegmenterParams = PARAMS) -> str | None:
    return range_doubt(of(depth), reduced_view(of(depth), 4, *params.limits[:2]), params)


def flat(z: float) -> np.ndarray:
    return np.full((CAMERA.height, CAMERA.width), z)


def test_millimetres_as_floats_are_doubted() -> None:
    assert "got 307200 pixels of 1500 … 1500 m" in (doubt_of_range(flat(1500.0)) or "")
    assert "within z_min … z_max (0.2 … 4 m)" in (doubt_of_range(flat(1500.0)) or "")


def test_what_lies_behind_the_limit_of_the_preset_is_doubted() -> None:
    assert "0.2 … 1.75 m" in (doubt_of_range(flat(2.0), SegmenterParams(preset="paper")) or "")


def test_depth_within_the_limits_is_not_doubted_even_where_the_view_misses_it() -> None:
    assert doubt_of_range(flat(1.5)) is None
    one = flat(9.0)
    one[1, 1] = 1.5
    assert doubt_of_range(one) is None


def test_a_picture_without_any_depth_is_not_doubted() -> None:
    assert doubt_of_range(flat(0.0)) is None


def boxes(frame_id: str, image_hw: tuple[int, int] = (CAMERA.height, CAMERA.width)) -> Detections:
    one = np.array([[1, 1, 9, 9]], np.float32)
    score = np.ones(1, np.float32)
    return Detections(xyxy=one, score=score, label=("cup",), image_hw=image_hw, stamp_ns=0, frame_id=frame_id)


def test_depth_of_another_frame_than_colour_is_doubted_with_what_to_do() -> None:
    text = registration_doubt(boxes("camera_color_optical_frame"), of(flat(1.0), "camera_depth_optical_frame"))
    assert text is not None and "got colour in 'camera_color_optical_frame' and depth in 'camera_depth" in text
    assert "align_depth.enable:=true" in text and "depth_registered" in text


@pytest.mark.parametrize(("seen", "measured"), [("a", "a"), ("", "a"), ("a", ""), ("", "")])
def test_one_frame_and_frames_without_a_name_are_not_doubted(seen: str, measured: str) -> None:
    assert registration_doubt(boxes(seen), of(flat(1.0), measured)) is None


def test_depth_of_another_size_and_frame_is_doubted_too() -> None:
    assert registration_doubt(boxes("a", (10, 20)), of(flat(1.0), "b")) is not None
    assert registration_doubt(boxes("a", (10, 20)), of(flat(1.0), "a")) is None
