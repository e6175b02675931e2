# SPDX-License-Identifier: Apache-2.0
"""Overlays of scenes that are known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from recording.folders import tum_folder

from objreg_ros.data import DepthImage, Intrinsics
from objreg_ros.geometry import pose
from objreg_ros.recording.inputs import choose_inputs
from objreg_ros.recording.opening import open_recording
from objreg_ros.report.pictures import WIDTH, Album, chosen_closures, chosen_refusals, data_uri, overlay
from objreg_ros.report.story import Story

from .runs import TRUTH, summary

CAMERA = Intrinsics(fx=300.0, fy=300.0, cx=159.5, cy=119.5, width=WIDTH, height=240)


def wall(shift: int = 0) -> DepthImage:
    """A wall at 2 m with a bright square, ``shift`` px to the right."""
    rgb = np.full((240, WIDTH, 3), 60, np.uint8)
    rgb[100:140, 140 + shift : 180 + shift] = 220
    return DepthImage(depth=np.full((240, WIDTH), 2.0, np.float32), rgb=rgb, intrinsics=CAMERA, stamp_ns=0)


def colourful(picture: np.ndarray) -> int:
    """Pixels of the overlap that are not grey."""
    return int((np.ptp(picture[90:150, 100:230].astype(int), axis=2) > 60).sum())


def test_the_right_motion_makes_grey_and_a_wrong_one_fringes() -> None:
    metres = 30 * 2.0 / CAMERA.fx  # what 30 px are on the wall
    moved = pose(np.eye(3), np.array([-metres, 0.0, 0.0]))
    assert colourful(overlay(wall(), wall(30), moved)) == 0
    assert colourful(overlay(wall(), wall(30), np.eye(4))) > 1500


def test_what_only_one_saw_stays_dark() -> None:
    away = pose(np.eye(3), np.array([1.0, 0.0, 0.0]))  # 150 px to the right
    picture = overlay(wall(), wall(), away)
    assert picture[10, 10].max() < 30 < picture[10, 300].max()


def test_false_closures_are_shown_first() -> None:
    story = Story.of("walk", summary(false=True), TRUTH)
    shown = chosen_closures(story, most=3)
    assert story.is_false(shown[0]) and len(shown) == 3
    assert not any(story.is_false(closure) for closure in shown[1:])


def test_only_what_was_tried_is_shown_as_refused() -> None:
    shown = chosen_refusals(Story.of("walk", summary(), TRUTH))
    assert [refusal.reason.value for refusal in shown] == ["texture_disagrees"] * 2


def test_a_picture_is_inside_the_page() -> None:
    assert data_uri(np.zeros((480, 640, 3), np.uint8)).startswith("data:image/jpeg;base64,/9j/")


def test_an_album_finds_the_pictures_of_a_moment(shared: Path) -> None:
    with open_recording(shared / "data" / "redkitchen_a") as recording:
        album = Album(recording, choose_inputs(recording.topics))
        seen = album.at(1_000_000_000)
        assert seen is not None and seen.rgb is not None
        assert abs(seen.stamp_ns - 1_000_000_000) < 50_000_000
        assert album.at(10**15) is None


def test_an_album_passes_over_a_picture_that_does_not_decode(tmp_path: Path) -> None:
    folder = tum_folder(tmp_path, frames=4)
    (folder / "depth/0.100000.png").write_bytes(b"no png")
    recording = open_recording(folder)
    seen = Album(recording, choose_inputs(recording.topics)).at(100_000_000)
    assert seen is not None and seen.stamp_ns != 100_000_000


@pytest.mark.parametrize("count", [0, 1])
def test_a_story_of_few_closures_shows_them_all(count: int) -> None:
    told = {**summary(), "constraints": summary()["constraints"][:count]}
    assert len(chosen_closures(Story.of("walk", told, TRUTH))) == count
