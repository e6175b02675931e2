# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import io

from tqdm import tqdm

from objreg_tools.cli.progress import FrameBar, Progress


def test_what_has_not_begun_is_taken_to_be_as_long_as_the_mean() -> None:
    progress = Progress(3)
    assert (progress.done, progress.total) == (0, None)
    progress.receive(0, 5, 100)
    progress.receive(1, 10, 200)
    assert (progress.done, progress.total) == (15, 450)


def test_an_item_that_ended_has_all_its_frames_and_one_that_never_began_has_none() -> None:
    progress = Progress(3)
    progress.receive(0, 5, 100)
    progress.end(0), progress.end(1)
    assert (progress.done, progress.total) == (100, 200)


def test_a_worker_that_begins_anew_goes_back() -> None:
    progress = Progress(1)
    progress.receive(0, 50, 100)
    progress.receive(0, 5, 100)
    assert (progress.done, progress.total) == (5, 100)


def test_the_bar_moves_within_a_recording_and_counts_those_that_ended() -> None:
    with tqdm(total=None, unit="frame", file=io.StringIO()) as drawn:
        bar = FrameBar(drawn, 2)
        bar.receive(0, 5, 100)
        assert (drawn.n, drawn.total) == (5, 200)
        bar.end(0)
        assert (drawn.n, drawn.postfix) == (100, "1 of 2 ended")
