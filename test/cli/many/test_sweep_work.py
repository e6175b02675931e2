# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from recording.sample_folders import tum_folder

from objreg_ros.data.images import ColourImage, Detections
from objreg_tools.cli.many import sweep_work
from objreg_tools.cli.many.batch_work import BatchWork
from objreg_tools.cli.many.sweep_work import Remembering, RevisitsFile, Share, shares, split, work
from objreg_tools.cli.recorded import RecordedOptions
from objreg_tools.cli.settings import read_settings

REC = Path("/r/a")


class Counting:
    """A detector that sees nothing, and counts how often it looked."""

    def __init__(self, masks: bool = False) -> None:
        self.looks, self.masks = 0, masks

    def detect(self, image: ColourImage) -> Detections:
        self.looks += 1
        hw = image.rgb.shape[:2]
        return Detections(
            xyxy=np.zeros((0, 4), np.float32), score=np.zeros(0, np.float32), label=(), image_hw=hw,
            stamp_ns=image.stamp_ns, instances=np.zeros(hw, np.uint16) if self.masks else None,
        )  # fmt: skip


def image(stamp_ns: int, grey: int = 0) -> ColourImage:
    return ColourImage(rgb=np.full((4, 4, 3), grey, np.uint8), stamp_ns=stamp_ns)


def run(folder: Path, *changes: str) -> BatchWork:
    return BatchWork.of(RecordedOptions(read_settings(None, changes)), folder, ())


def test_each_picture_is_detected_once_and_another_of_its_stamp_anew() -> None:
    counting = Counting()
    remembering = Remembering(lambda: counting)
    seen = [remembering.detect(image(*one)) for one in ((1,), (2,), (1,), (1, 9))]
    assert counting.looks == 3 and seen[0] is seen[2]


def test_masks_beyond_the_memory_are_detected_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sweep_work, "MOST_BYTES", 40)
    counting = Counting(masks=True)  # of 32 bytes
    remembering = Remembering(lambda: counting)
    for stamp in (1, 1, 2, 2):
        remembering.detect(image(stamp))
    assert counting.looks == 3


def test_runs_of_one_detector_share_it_and_revisits_go_with_the_first(tmp_path: Path) -> None:
    runs = [run(tmp_path / f"{t}{o}", f"detector.threshold={t}", f"registrar.least_odds={o}") for t in (0.3, 0.4)
            for o in (20, 30)]  # fmt: skip
    kept = RevisitsFile(tmp_path, runs[0])
    made = shares(REC, [runs[0], runs[2], runs[1], runs[3]], kept)
    assert [one.runs for one in made] == [(runs[0], runs[1]), (runs[2], runs[3])]
    assert [one.revisits for one in made] == [kept, None]
    assert shares(REC, [], kept) == [Share(REC, (), kept)] and shares(REC, [], None) == []


def test_shares_are_parted_where_there_are_more_workers_and_nothing_is_done_twice(tmp_path: Path) -> None:
    runs = tuple(run(tmp_path / str(k)) for k in range(5))
    kept = RevisitsFile(tmp_path, runs[0])
    assert split([Share(REC, runs, kept)], 1) == [Share(REC, runs, kept)]
    two = split([Share(REC, runs, kept)], 2)
    assert two == [Share(REC, runs[:3], kept), Share(REC, runs[3:])]
    assert [one.runs for one in split([Share(REC, runs)], 9)] == [(one,) for one in runs]
    assert split([Share(REC, (), kept)], 9) == [Share(REC, (), kept)]


def test_a_run_that_fails_stops_no_other_of_its_share(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recording = tum_folder(tmp_path / "tum", frames=2)
    good, bad = run(tmp_path / "good"), run(tmp_path / "bad", "segmenter.source=points")
    for one in (good, bad):
        one.folder.mkdir()
    monkeypatch.setattr(sweep_work, "_detector", lambda _: Counting())
    failed = work(Share(recording, (bad, good), RevisitsFile(tmp_path, good)))
    assert list(failed.runs) == [str(bad.folder)] and good.is_done(recording) and failed.revisits == ""


def test_revisits_hold_until_the_recording_changes(tmp_path: Path) -> None:
    recording = tum_folder(tmp_path / "tum", frames=2)
    kept = RevisitsFile(tmp_path / "revisits", run(tmp_path))
    assert kept.read(recording) is None
    kept.write(recording)
    assert kept.read(recording) == []
    for text in ("", "[]", "{}", '{"revisits": [1], "made": {}}', "[" * 100_000):
        (file,) = (tmp_path / "revisits").iterdir()
        good = file.read_text()
        file.write_text(text)
        assert kept.read(recording) is None
        file.write_text(good)
    (recording / "rgb.txt").write_text("")
    assert kept.read(recording) is None
