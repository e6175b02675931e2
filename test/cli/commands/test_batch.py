# SPDX-License-Identifier: Apache-2.0
"""Many recordings at once: the same on any number of workers, never twice, and none stops another."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pyarrow.parquet
import pytest
from click.testing import CliRunner, Result
from detector.tiny_model import save_constant_model, tf_outputs
from distributed import LocalCluster
from recording.sample_folders import tum_folder

from objreg_tools.cli.commands.batch import command
from objreg_tools.workers import Done

TIMES = ("about", "stage_ms", "batch")


@pytest.fixture
def arguments(tmp_path: Path) -> list[object]:
    """Two recordings, and the model that sees one cup in the middle of every picture."""
    (tmp_path / "labelmap.txt").write_text("cup\ntv\n")
    model = save_constant_model(tmp_path / "tiny.onnx", tf_outputs([[0.3, 0.3, 0.7, 0.7]], [0], [0.9]))
    return [tum_folder(tmp_path / "a", frames=3), tum_folder(tmp_path / "b", frames=2), "--model", model]


@pytest.fixture
def alone(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """The work is done in this process; what of it was asked for."""
    asked: list[Path] = []

    def here(work: Any, items: list[Path], workers: int | None, scheduler: str, on_progress: Any = None) -> Any:
        for item in items:
            asked.append(item)
            try:
                yield Done(item, work(item))
            except OSError as error:
                yield Done(item, error=error)

    monkeypatch.setattr("objreg_tools.cli.commands.batch.spread", here)
    return asked


def batch(*arguments: object) -> Result:
    return CliRunner().invoke(
        command, [str(argument) for argument in arguments], catch_exceptions=False, standalone_mode=False
    )


def results_in(folder: Path) -> dict[str, Any]:
    summaries = {file.name: json.loads(file.read_text()) for file in folder.glob("*.json")}
    return {name: {k: v for k, v in one.items() if k not in TIMES} for name, one in summaries.items()}


def test_one_worker_and_two_give_the_same(arguments: list[object], tmp_path: Path) -> None:
    with LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None) as cluster:
        one = batch(*arguments, "--out", tmp_path / "one", "--scheduler", cluster.scheduler_address)
    two = batch(*arguments, "--out", tmp_path / "two", "--workers", 2)
    assert one.return_value == two.return_value == 0 and "recordings: 2, failed: 0, frames: 5" in two.output
    assert len(results_in(tmp_path / "one")) == 2 and results_in(tmp_path / "one") == results_in(tmp_path / "two")
    for name in ("constraints.parquet", "refusals.parquet"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


def test_what_is_done_is_not_done_again_unless_something_changed(
    arguments: list[object], tmp_path: Path, alone: list[Path]
) -> None:
    first, out = arguments[0], ("--out", tmp_path / "out")
    batch(*arguments[1:], *out)
    again = batch(*arguments, *out)
    assert [path.name for path in alone] == ["b", "a"] and "1 of 2 recordings are done already" in again.output
    changed = batch(first, *arguments[2:], *out, "--set", "registrar.seed=7", "--max-frames", 1)
    assert "! 1 were made otherwise and are done anew: max_frames, registrar.seed changed" in changed.output
    assert len(alone) == 3 and "recordings: 1, failed: 0, frames: 1" in changed.output


def test_each_recording_has_its_page_and_one_that_is_gone_is_drawn_without_a_run(
    arguments: list[object], tmp_path: Path, alone: list[Path]
) -> None:
    out = tmp_path / "out"
    batch(*arguments, "--out", out, "--no-pages")
    assert [*out.glob("?-*.html")] == [] and len(alone) == 2
    results = {file: file.stat().st_mtime_ns for file in out.glob("*.json")}
    again = batch(*arguments, "--out", out)
    assert len([*out.glob("?-*.html")]) == 2 and "2 of 2 recordings are done already" in again.output
    assert {file: file.stat().st_mtime_ns for file in out.glob("*.json")} == results
    batch(*arguments, "--out", out)
    assert len(alone) == 4, "what has both is not asked for"
    page = (out / "report.html").read_text()
    assert all(f'href="{file.with_suffix(".html").name}"' in page for file in results)


def test_a_page_that_cannot_be_drawn_costs_no_result(
    arguments: list[object], tmp_path: Path, alone: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("no ink")

    monkeypatch.setattr("objreg_tools.cli.many.batch_work.write_report", fail)
    result = batch(*arguments, "--out", tmp_path / "out")
    assert result.return_value == 0 and "! a: no page: no ink" in result.output


def test_findings_are_in_the_terminal_on_the_page_and_in_the_table(
    arguments: list[object], tmp_path: Path, alone: list[Path]
) -> None:
    result = batch(*arguments, "--out", tmp_path / "out")
    (first, *_) = pyarrow.parquet.read_table(tmp_path / "out/recordings.parquet").to_pylist()[0]["findings"]
    assert f"  ! {first}" in result.output and "<h2>Findings</h2>" in (tmp_path / "out/report.html").read_text()


def test_two_batches_are_compared_and_another_folder_is_only_read(
    arguments: list[object], tmp_path: Path, alone: list[Path]
) -> None:
    before = tmp_path / "before"
    batch(*arguments, "--out", before)
    files = {file: file.read_bytes() for file in before.iterdir()}
    again = ("--out", tmp_path / "now", "--against", before)
    assert f"against {before}: 0 of 2 recordings changed" in batch(*arguments, *again).output
    fewer = batch(*arguments, *again, "--max-frames", 2)
    assert "max_frames: None → 2" in fewer.output and "1 of 2 recordings changed" in fewer.output
    assert "next: objreg report" in fewer.output and "Against " in (tmp_path / "now/report.html").read_text()
    assert files == {file: file.read_bytes() for file in before.iterdir()}


def test_half_a_result_is_none(arguments: list[object], tmp_path: Path, alone: list[Path]) -> None:
    batch(*arguments[1:], "--out", tmp_path / "out")
    (file,) = (tmp_path / "out").glob("*.json")
    file.write_text(file.read_text()[:100])
    assert batch(*arguments[1:], "--out", tmp_path / "out").return_value == 0 and len(alone) == 2


EDITS: tuple[tuple[str, Any], ...] = (
    ("frames", None), ("frames", -1), ("frames", 1e300), ("frames", 10**400), ("objects", True),
    ("truth", []), ("truth", {}), ("truth", {"count": 1, "strict": "a", "loose": 0, "false": None}),
    ("constraints", None), ("constraints", [{}]), ("constraints", 5), ("refusals", ["a"]),
    ("refusals", [{"from_ns": 2**70, "to_ns": 1, "T_from_to": None, "reason": "a", "detail": "b", "evidence": {}}]),
    ("refusals", [{"from_ns": 2, "to_ns": 1, "T_from_to": [[1]], "reason": "a", "detail": "b", "evidence": {}}]),
    ("refusals", [{"from_ns": 2, "to_ns": 1, "T_from_to": None, "reason": "\ud800", "detail": "", "evidence": {}}]),
    ("rejected", {"a": "b"}), ("rejected", 7), ("stage_ms", {"total": {}}), ("stage_ms", {"total": {"p50": "x"}}),
    ("batch", None), ("batch", {}), ("batch", {"made": None}), ("batch", {"made": {}, "seconds": "s", "notes": []}),
    ("batch", {"made": {}, "seconds": float("nan"), "notes": []}),
)  # fmt: skip


@pytest.mark.parametrize("missing", [False, True])
def test_a_result_that_was_edited_is_made_anew_and_the_user_learns_of_it(
    missing: bool, arguments: list[object], tmp_path: Path, alone: list[Path]
) -> None:
    batch(*arguments[1:], "--out", tmp_path / "out")
    (file,) = (tmp_path / "out").glob("*.json")
    good, anew = json.loads(file.read_text()), 1
    for name, value in EDITS:
        edited = {key: one for key, one in good.items() if key != name} if missing else {**good, name: value}
        file.write_text(json.dumps(edited))
        result = batch(*arguments[1:], "--out", tmp_path / "out")
        anew += 1
        assert result.return_value == 0 and "recordings: 1, failed: 0, frames: 2" in result.output
        assert f"{file.name}: expected a result of a batch" in result.output and "it is made anew" in result.output
        assert len(alone) == anew and results_in(tmp_path / "out") == {
            file.name: {k: good[k] for k in good if k not in TIMES}
        }


def test_a_recording_that_fails_stops_no_other(arguments: list[object], tmp_path: Path, alone: list[Path]) -> None:
    result = batch(tmp_path / "gone", *arguments[1:], "--out", tmp_path / "out")
    assert result.return_value == 3 and "recordings: 2, failed: 1, frames: 2" in result.output
    table = pyarrow.parquet.read_table(tmp_path / "out/recordings.parquet").to_pylist()
    assert [(row["name"], row["frames"]) for row in table] == [("gone", 0), ("b", 2)] and "gone" in table[0]["error"]
    assert table[0]["error"] in result.output and "<h2>Failed</h2>" in (tmp_path / "out/report.html").read_text()


def test_two_recordings_of_one_name_have_their_own_results(
    arguments: list[object], tmp_path: Path, alone: list[Path]
) -> None:
    other = tum_folder(tmp_path / "elsewhere/b", frames=4)
    assert "recordings: 2, failed: 0, frames: 6" in batch(other, *arguments[1:], "--out", tmp_path / "out").output


def test_a_store_that_all_would_share_is_refused(arguments: list[object], tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"registrar\.store: expected none"):
        batch(*arguments, "--out", tmp_path / "out", "--set", f"registrar.store={tmp_path / 'store.db'}")
