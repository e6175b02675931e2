# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from collections.abc import Callable

from objreg_ros.plausibility.finding import Finding
from objreg_tools.cli.looks.first_look import look
from objreg_tools.offline.run import Run

WRONG = Finding("the focal length is another", "c", "t", "camera-focal-length")


def test_what_the_first_frames_show_is_found() -> None:
    seen = look(lambda show: Run(frames=3, findings=(WRONG,)))
    assert seen.runs and seen.findings == (WRONG,)


def test_a_recording_of_which_no_frame_gets_through_does_not_run() -> None:
    seen = look(lambda show: Run())
    assert not seen.runs and [finding.anchor for finding in seen.findings] == ["no-frame-got-through"]


def test_a_file_that_breaks_in_its_middle_runs_up_to_there() -> None:
    def broken(show: Callable[[int], None]) -> Run:
        show(2)
        raise ValueError("bag: cut off")

    seen = look(broken)
    assert seen.runs and [finding.what for finding in seen.findings] == ["bag: cut off"]
