# SPDX-License-Identifier: Apache-2.0
"""Every combination over all recordings: what is done is not done again, and detections are shared."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pyarrow.parquet
import pytest
from click.testing import CliRunner, Result
from detector.tiny_model import save_constant_model, tf_outputs
from recording.sample_folders import tum_folder

from objreg_tools.cli.commands.sweep import command
from objreg_tools.cli.many import sweep_work
from objreg_tools.cli.many.batch_work import BatchWork
from objreg_tools.workers import Done

ODDS = ("--set", "registrar.least_odds=20,75,300")


@pytest.fixture
def arguments(tmp_path: Path) -> list[object]:
    """Two recordings, and the model that sees one cup in the middle of every picture."""
    (tmp_path / "labelmap.txt").write_text("cup\ntv\n")
    model = save_constant_model(tmp_path / "tiny.onnx", tf_outputs([[0.3, 0.3, 0.7, 0.7]], [0], [0.9]))
    recordings = [tum_folder(tmp_path / "a", frames=3), tum_folder(tmp_path / "b", frames=2)]
    return [*recordings, "--model", model, "--out", tmp_path / "out", "--workers", 1]


@pytest.fixture
def alone(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """The work is done in this process; the folder of each run that was done."""
    ran: list[Path] = []
    begin = BatchWork.run

    def counted(self: BatchWork, *args: Any) -> None:
        ran.append(self.folder)
        begin(self, *args)

    def here(work: Any, items: list[Any], *_: Any) -> Any:
        return (Done(item, work(item)) for item in items)

    monkeypatch.setattr(BatchWork, "run", counted)
    monkeypatch.setattr("objreg_tools.cli.commands.sweep.spread", here)
    return ran


def sweep(*arguments: object) -> Result:
    return CliRunner().invoke(command, [*map(str, arguments)], catch_exceptions=False, standalone_mode=False)


def test_every_combination_of_all_recordings_is_run_and_written(
    arguments: list[object], tmp_path: Path, alone: list[Path]
) -> None:
    result = sweep(*arguments, *ODDS, "--set", "detector.threshold=0.3,0.4", "--set", "registrar.seed=7")
    assert result.return_value == 0 and len(alone) == 12 and len(set(alone)) == 6
    assert (
        "6 (3 × 2) combinations of registrar.least_odds, detector.threshold over 2 recordings: 12 runs" in result.output
    )
    out = tmp_path / "out"
    written = json.loads((out / "sweep.json").read_text())
    assert written["best"] is None and not written["judged"] and "no combination is named the best" in result.output
    assert written["about"]["registrar.seed"] == 7 and [one["frames"] for one in written["combinations"]] == [5] * 6
    rows = pyarrow.parquet.read_table(out / "sweep.parquet").to_pylist()
    assert len(rows) == 12 and {row["registrar.least_odds"] for row in rows} == {20.0, 75.0, 300.0}
    assert all((out / row["file"]).is_file() for row in rows)
    assert "6 combinations over 2 recordings" in (out / "report.html").read_text()


def test_workers_give_the_same_as_this_process(arguments: list[object], tmp_path: Path) -> None:
    assert sweep(*arguments, *ODDS, "--workers", 2).return_value == 0
    written = json.loads((tmp_path / "out/sweep.json").read_text())
    assert [one["frames"] for one in written["combinations"]] == [5, 5, 5]
    assert len([*(tmp_path / "out").glob("runs/*/*.json")]) == 6


def test_what_is_done_is_not_done_again_and_a_new_value_adds_its_runs_alone(
    arguments: list[object], alone: list[Path]
) -> None:
    sweep(*arguments, "--set", "registrar.least_odds=20,75")
    again = sweep(*arguments, "--set", "registrar.least_odds=75,20")
    assert len(alone) == 4 and "4 runs are done already" in again.output
    assert "4 runs are done already" in sweep(*arguments, *ODDS).output and len(alone) == 6


def test_pictures_are_detected_once_for_all_settings_of_the_registrar(
    arguments: list[object], alone: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[Any] = []
    begin = sweep_work._detector
    monkeypatch.setattr(sweep_work, "_detector", lambda run: made.append(begin(run)) or made[-1])
    sweep(*arguments, *ODDS)
    assert len(made) == 2 and [len(one._seen) for one in made] == [3, 2]


def test_a_recording_that_fails_stops_no_other(arguments: list[object], tmp_path: Path, alone: list[Path]) -> None:
    result = sweep(tmp_path / "gone", *arguments, *ODDS)
    assert result.return_value == 3 and "(1 failed)" in result.output and "gone" in result.output
    assert "<h2>Failed</h2>" in (tmp_path / "out/report.html").read_text()


@pytest.mark.parametrize("change", ["registrar.least_odds=20", "registrar.least_odds=20,x", "registrar.nothing=1,2"])
def test_what_cannot_be_swept_is_refused_before_a_run(change: str, arguments: list[object], alone: list[Path]) -> None:
    with pytest.raises(ValueError, match=r"registrar|--set"):
        sweep(*arguments, "--set", change)
    assert alone == []


def test_a_memory_that_all_would_share_is_refused(arguments: list[object], tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"registrar\.store: expected none"):
        sweep(*arguments, *ODDS, "--set", f"registrar.store={tmp_path / 'store.db'}")
