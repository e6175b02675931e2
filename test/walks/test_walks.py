# SPDX-License-Identifier: Apache-2.0
"""Users walk through what there is, each by what the last command said, and none comes to a dead end."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from report.chromium import chromium

from . import many, odd_bags, own_detector, programmer, reader, realsense, researcher, student, trying, twenty
from .walk import ROOM, Said, Walk

pytestmark = pytest.mark.ros


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated recording, from which the command leads on."""
    folder = tmp_path_factory.mktemp("walks")
    assert Walk(folder).type("simulate", "room", *ROOM).command() == ["inspect", "room"]
    return folder / "room"


@pytest.fixture(scope="module")
def moving(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated recording of so many frames a second that its motion can be followed."""
    folder = tmp_path_factory.mktemp("moving")
    Walk(folder).type("simulate", "room", *trying.MOVING)
    return folder / "room"


@pytest.fixture(scope="module")
def study(room: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder in which the researcher has worked."""
    folder = tmp_path_factory.mktemp("study")
    researcher.walk(folder, room)
    return folder


@pytest.fixture
def browser() -> Iterator[Any]:
    """Chromium without a window."""
    with chromium() as opened:
        yield opened


def test_a_student_comes_from_a_tum_folder_to_a_page(room: Path, tmp_path: Path) -> None:
    student.walk(tmp_path, room)


def test_a_bag_of_a_realsense_without_odometry_needs_no_option(room: Path, tmp_path: Path) -> None:
    realsense.walk(tmp_path, room)


def test_a_programmer_types_the_lines_of_the_readme_over_pictures_of_their_own(room: Path, tmp_path: Path) -> None:
    programmer.walk(tmp_path, room)


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
def test_an_odd_recording_is_put_right_by_what_is_told(way: Any, room: Path, tmp_path: Path) -> None:
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


def test_a_researcher_compares_two_runs_and_reads_what_they_wrote(study: Path) -> None:
    assert (study / "both.html").is_file()


def test_a_researcher_goes_from_many_recordings_to_the_best_parameters(room: Path, tmp_path: Path) -> None:
    many.walk(tmp_path, room)


def test_an_engineer_hears_constraints_refusals_and_diagnostics_of_a_robot(
    room: Path, tmp_path: Path, domain: int
) -> None:
    pytest.importorskip("rclpy", reason="ROS is not installed")
    from ros.graph import Graph

    from . import engineer

    graph = Graph(domain, tmp_path)
    try:
        engineer.walk(graph, tmp_path, room)
    finally:
        graph.close()


def test_a_reader_finds_a_pair_on_the_page(browser: Any, study: Path) -> None:
    reader.walk(browser, study / "both.html")


def test_a_command_that_names_no_next_step_is_a_dead_end() -> None:
    with pytest.raises(AssertionError, match="a dead end"):
        Said("! nothing was detected\n", "").advice()
    assert Said("    next: objreg report 'a b.json'\n", "").command() == ["report", "a b.json"]
