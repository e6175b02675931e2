# SPDX-License-Identifier: Apache-2.0
"""What cannot be read ends every command in one line and exit 1, in a process of its own."""

from __future__ import annotations

from pathlib import Path

import pytest

from .hostile import call_each, good_folder, hostile_files, hostile_recordings


def require_one_line_each(outcomes: dict[str, tuple[object, str]]) -> None:
    """Exit 1, and one line that says what is wrong behind notes and what is under way."""
    wrong = {name: (code, said[-1500:]) for name, (code, said) in outcomes.items() if not _is_one_line(code, said)}
    assert outcomes and not wrong, wrong


def _is_one_line(code: object, said: str) -> bool:
    lines = [line for line in said.splitlines() if not line.startswith(("! ", "preparing "))]
    return code == 1 and len(lines) == 1 and lines[0].startswith("objreg: ")


@pytest.mark.parametrize(
    "words",
    [
        ["inspect", "{}"],
        ["offline", "{}"],
        ["replay", "{}", "--wait", "0"],
        ["convert", "{}", "out"],
        ["demo", "{}"],
        ["report", "{}"],
    ],
    ids=lambda words: words[0],
)
def test_a_recording_that_cannot_be_read_is_refused(words: list[str], tmp_path: Path) -> None:
    files = hostile_recordings(tmp_path)
    outcomes = call_each({name: [word.format(file) for word in words] for name, file in files.items()}, tmp_path)
    require_one_line_each(outcomes)
    assert not (tmp_path / "out").exists()


def test_a_run_that_cannot_be_read_is_refused_by_report(tmp_path: Path) -> None:
    files = hostile_files(tmp_path, ".json")
    require_one_line_each(call_each({name: ["report", str(file)] for name, file in files.items()}, tmp_path))


def test_a_file_that_is_no_store_is_refused_by_export(tmp_path: Path) -> None:
    files = hostile_files(tmp_path, ".db")
    calls = {name: ["export", str(file), str(tmp_path / "new")] for name, file in files.items()}
    require_one_line_each(call_each(calls, tmp_path))


@pytest.mark.parametrize(
    ("name", "option"), [("offline", "--params"), ("offline", "--model"), ("offline", "--labels"), ("demo", "--params")]
)
def test_a_file_of_an_option_that_cannot_be_read_is_refused(name: str, option: str, tmp_path: Path) -> None:
    folder = good_folder(tmp_path / "tum")
    files = hostile_files(tmp_path, {"--params": ".yaml", "--model": ".onnx", "--labels": ".txt"}[option])
    if option == "--params":
        del files["empty"]  # which says nothing, and may
    if option == "--labels":  # one label of any name
        for one_label in ("deep JSON", "deep YAML", "a huge number", "text", "zeros"):
            del files[one_label]
    calls = {what: [name, str(folder), option, str(file)] for what, file in files.items()}
    require_one_line_each(call_each(calls, tmp_path))


def test_what_is_nested_in_a_setting_is_refused(tmp_path: Path) -> None:
    folder = good_folder(tmp_path / "tum")
    deep = "[" * 50_000
    calls = {
        name: ["offline", str(folder), "--set", f"{name}={deep}"]
        for name in ("registrar.T_base_camera", "registrar.seed", "detector.threshold")
    }
    require_one_line_each(call_each(calls, tmp_path))


def test_what_simulate_and_fetch_model_cannot_use_is_refused(tmp_path: Path) -> None:
    calls = {
        "simulate": ["simulate", str(tmp_path), "--frames", "2"],
        "camera": ["simulate", str(tmp_path / "x"), "--intrinsics", "nan,1,1,1"],
        "size": ["simulate", str(tmp_path / "x"), "--size", "9" * 5000],
        "http": ["fetch-model", "http://127.0.0.1:9/a.onnx"],
        "nobody": ["fetch-model", "https://127.0.0.1:9/a.onnx", "--folder", str(tmp_path)],
        "URL": ["fetch-model", "https://[::1/a.onnx"],
    }
    require_one_line_each(call_each(calls, tmp_path))
