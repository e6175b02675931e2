# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner
from detector.tiny_model import save_constant_model, tf_outputs
from recording.sample_folders import tum_folder

from objreg_tools.cli import group


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A detector that sees one cup in the middle of every picture."""
    folder = tmp_path_factory.mktemp("model")
    (folder / "labelmap.txt").write_text("cup\ntv\n")
    return save_constant_model(folder / "tiny.onnx", tf_outputs([[0.3, 0.3, 0.7, 0.7]], [0], [0.9]))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tum_folder(tmp_path_factory.mktemp("pair") / "kitchen", frames=4)


def paired(*words: object) -> str:
    result = CliRunner().invoke(group, ["pair", *map(str, words)], catch_exceptions=False, standalone_mode=False)
    return result.stdout


def test_two_frames_are_registered_and_their_steps_are_shown(folder: Path, model: Path, tmp_path: Path) -> None:
    page, file = tmp_path / "pair.html", tmp_path / "pair.json"
    said = paired(folder, "0.02", "0.3", "--model", model, "--page", page, "--json", file)
    summary = json.loads(file.read_text())
    assert [frame["stamp_ns"] for frame in summary["frames"]] == [0, 300_000_000] and summary["start_ns"] == 0
    assert summary["truth"] == {"rotation_deg": 0.0, "translation_m": 1.5} and not summary["accepted"]
    assert "A  0.000 s, 0 ns" in said and "B  0.300 s" in said and f"refused: {summary['reason']}" in said
    assert "kitchen, one pair" in page.read_text()


def test_stamps_name_frames_too_and_frames_about_them_are_fused(folder: Path, model: Path) -> None:
    words = (folder, "0ns", "300000000", "--model", model, "--json", "-", "--keyframes", "-q")
    assert len(json.loads(paired(*words))["frames"]) == 2


def test_quietly_the_verdict_is_all_there_is(folder: Path, model: Path) -> None:
    assert paired(folder, "0", "0.3", "--model", model, "-q").startswith("refused: ")


@pytest.mark.parametrize(
    ("a", "b", "match"), [("0", "x", "B: expected seconds"), ("60", "0", "expected a frame within")]
)
def test_a_time_that_is_none_or_has_no_frame_is_refused(folder: Path, model: Path, a: str, b: str, match: str) -> None:
    with pytest.raises(ValueError, match=match):
        paired(folder, a, b, "--model", model)
