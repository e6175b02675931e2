# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner
from detector.tiny_model import save_constant_model, tf_outputs
from recording.sample_folders import tum_folder

from objreg_ros.plausibility.finding import Finding
from objreg_tools.cli import group
from objreg_tools.cli.commands import try_

WRONG = Finding("by its motion the camera has another focal length", "c", "t", "camera-focal-length")


@pytest.fixture(autouse=True)
def no_models_of_the_user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="session")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A detector that sees one cup in the middle of every picture."""
    folder = tmp_path_factory.mktemp("model")
    (folder / "labelmap.txt").write_text("cup\ntv\n")
    return save_constant_model(folder / "tiny.onnx", tf_outputs([[0.3, 0.3, 0.7, 0.7]], [0], [0.9]))


def tried(*words: object, code: int = 0) -> str:
    """What is said on standard output; a progress bar and what is odd about the options are on the other."""
    result = CliRunner().invoke(group, ["try", *map(str, words)], catch_exceptions=False, standalone_mode=False)
    assert (result.return_value or 0) == code, result.output
    return result.stdout


def test_a_folder_becomes_a_page_and_a_json_of_its_name(model: Path, tmp_path: Path) -> None:
    said = tried(tum_folder(tmp_path / "kitchen", frames=4), "--model", model)
    page, run = (tmp_path / f"kitchen.{end}" for end in ("html", "json"))
    summary = json.loads(run.read_text())
    assert summary["assumed"]["colour"] == "rgb/" and "as asked for" in summary["assumed"]["model"]
    assert summary["frames"] == 4 and summary["trajectory"] is not None
    text = page.read_text()
    assert "What was assumed" in text and all(name in text for name in summary["assumed"])
    assert "wrote kitchen.html and kitchen.json" in said and page.as_uri() in said
    assert said.index("assumed:") < said.index("No loop was closed")


def test_the_model_of_simulation_is_named_first_where_the_recording_is_real(tmp_path: Path) -> None:
    said = tried(tum_folder(tmp_path / "kitchen", frames=3), "--out", tmp_path / "new" / "pages")
    first = said.splitlines()
    assert first[0].endswith("was trained in simulation, and this recording is real")
    assert "objreg fetch-model" in first[2] and "trained in simulation, as no other is installed" in said
    findings = json.loads((tmp_path / "new/pages/kitchen.json").read_text())["findings"]
    assert [row["anchor"] for row in findings].count("model-of-simulated-rooms") == 1


def test_what_is_wrong_with_the_stream_stands_before_what_the_run_did(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, run_of = tum_folder(tmp_path / "kitchen", frames=3), try_.Opened.rehearse
    seen = []

    def rehearse(*asked: object, **given: object) -> object:
        run = run_of(*asked, **given)  # type: ignore[arg-type]
        run.findings = (WRONG,)
        seen.append(run)
        return run

    monkeypatch.setattr(try_.Opened, "rehearse", rehearse)
    monkeypatch.setattr(try_, "_run", lambda opened: seen[-1])
    said = tried(folder, "--model", model).splitlines()
    assert said[0] == f"! {WRONG.what}" and len([line for line in said if WRONG.what in line]) == 2  # and the verdict
    body = (tmp_path / "kitchen.html").read_text().partition("<h1>kitchen</h1>")[2].lstrip()
    assert body.startswith('<div class="card finding">\n<p class="what">' + WRONG.what)


def test_what_the_run_does_not_find_again_is_said(model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(try_, "look", lambda *_: try_look(WRONG))
    said = tried(tum_folder(tmp_path / "kitchen", frames=3), "--model", model)
    assert f"seen before the run, and not found in it: {WRONG.what}" in said


def try_look(*findings: Finding) -> object:
    from objreg_tools.cli.looks.first_look import FirstLook
    from objreg_tools.offline.run import Run

    return FirstLook(Run(), True, findings)


def test_an_earlier_page_gives_place_and_another_file_does_not(model: Path, tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "kitchen", frames=3)
    for _ in range(2):
        tried(folder, "--model", model, "-q")
    (tmp_path / "kitchen.json").write_text('{"fx": 500}')
    with pytest.raises(ValueError, match=r"--out: expected nothing but what an earlier run wrote at kitchen\.json"):
        tried(folder, "--model", model)
    assert (tmp_path / "kitchen.json").read_text() == '{"fx": 500}'


def test_nothing_is_written_into_the_recording(model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tum_folder(tmp_path / "kitchen", frames=3)
    monkeypatch.chdir(folder)
    with pytest.raises(ValueError, match=r"--out: expected a place apart from all that is read"):
        tried(folder, "--model", model)


def test_quietly_the_verdict_and_the_files_are_all_there_is(model: Path, tmp_path: Path) -> None:
    said = tried(tum_folder(tmp_path / "kitchen", frames=3), "--model", model, "-q").splitlines()
    assert len(said) == 2 and said[1] == "wrote kitchen.html and kitchen.json"


def test_a_browser_shows_the_page_unless_that_is_not_wanted(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[Path] = []
    monkeypatch.setattr(try_, "open_page", lambda page: shown.append(page) is None)
    folder = tum_folder(tmp_path / "kitchen", frames=3)
    assert "open it in a browser" in tried(folder, "--model", model, "--no-open") and shown == []
    assert "open it in a browser" not in tried(folder, "--model", model) and shown == [Path("kitchen.html")]


def test_a_recording_without_a_frame_ends_with_3_and_a_page(model: Path, tmp_path: Path) -> None:
    folder = tum_folder(tmp_path / "kitchen", frames=3)
    for picture in (folder / "depth").iterdir():
        picture.write_bytes(picture.read_bytes()[:60])
    said = tried(folder, "--model", model, code=3)
    assert "no frame got through" in said.splitlines()[0] and (tmp_path / "kitchen.html").is_file()
