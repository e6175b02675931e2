# SPDX-License-Identifier: Apache-2.0
"""Users bring recordings of their own, odd ones, wrong ones and many."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from . import odd_bags, own_detector, trying, twenty
from .walk import Walk

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def moving(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated recording of so many frames a second that its motion can be followed."""
    folder = tmp_path_factory.mktemp("moving")
    Walk(folder).type("simulate", "room", *trying.MOVING)
    return folder / "room"


@pytest.mark.parametrize("way", [own_detector.recorded_detections, own_detector.own_model])
def test_who_has_a_detector_of_their_own_gets_on_with_it(way: Any, room: Path, tmp_path: Path) -> None:
    way(tmp_path, room)


def test_of_twenty_recordings_the_one_that_is_cut_off_is_named_and_run_again(room: Path, tmp_path: Path) -> None:
    twenty.walk(tmp_path, room)


@pytest.mark.parametrize(
    "way",
    [
        odd_bags.colour_under_an_odd_name,
        odd_bags.no_camera_info,
        odd_bags.wrong_depth_scale,
        odd_bags.garbage_in_place_of_depth,
    ],
)
def test_an_odd_recording_is_put_right_by_what_is_advised(way: Any, room: Path, tmp_path: Path) -> None:
    way(tmp_path, room)


@pytest.mark.parametrize(
    "way",
    [
        trying.wrong_focal_length,
        trying.wrong_depth_scale,
        trying.odometry_of_another_robot,
    ],
)
def test_who_tries_a_recording_reads_first_what_is_wrong_with_it(way: Any, moving: Path, tmp_path: Path) -> None:
    way(tmp_path, moving)


def test_who_tries_a_recording_has_a_page_and_goes_on_to_a_pair(room: Path, tmp_path: Path) -> None:
    trying.a_simulated_recording(tmp_path, room)
