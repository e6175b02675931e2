# SPDX-License-Identifier: Apache-2.0
"""Users walk through what there is, each by what the last command said, and none comes to a dead end."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from report.chromium import chromium

from . import many, programmer, reader, realsense, researcher, student
from .walk import Said

pytestmark = pytest.mark.slow


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


def test_a_researcher_compares_two_runs_and_reads_what_they_wrote(study: Path) -> None:
    assert (study / "both.html").is_file()


def test_a_researcher_goes_from_many_recordings_to_the_best_parameters(room: Path, tmp_path: Path) -> None:
    many.walk(tmp_path, room)


def test_a_reader_finds_a_pair_on_the_page(browser: Any, study: Path) -> None:
    reader.walk(browser, study / "both.html")


def test_a_command_that_names_no_next_step_is_a_dead_end() -> None:
    with pytest.raises(AssertionError, match="a dead end"):
        Said("! nothing was detected\n", "").advice()
    assert Said("    next: objreg report 'a b.json'\n", "").command() == ["report", "a b.json"]
