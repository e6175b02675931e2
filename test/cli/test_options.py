# SPDX-License-Identifier: Apache-2.0
"""What the shared options make of the words of a command line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import CliRunner, Result

from objreg_ros.cli import options
from objreg_ros.cli.options import require_writable
from objreg_ros.cli.settings import read_settings


def parsed(*words: str) -> tuple[Result, dict[str, Any]]:
    """What became of a command with all the options, and what it was told."""
    told: dict[str, Any] = {}

    @click.command()
    @options.recording
    @options.remap
    @options.params
    @options.change
    @options.model
    @options.labels
    def command(**asked: Any) -> None:
        told.update(asked)

    return CliRunner().invoke(command, words), told


def test_without_options_nothing_is_asked_for() -> None:
    result, told = parsed("some/bag")
    assert result.exit_code == 0 and told == {
        "recording": Path("some/bag"), "remaps": (), "params_file": None, "changes": (), "model": None, "labels": None,
    }  # fmt: skip


def test_remaps_and_changes_come_in_their_order_as_often_as_they_are_said() -> None:
    _, told = parsed(
        "bag", "--set", "registrar.seed=4", "--remap", "odom:=/o", "--remap", "depth:=", "--set", "a.b=c=d"
    )
    assert told["remaps"] == ("odom:=/o", "depth:=") and told["changes"] == ("registrar.seed=4", "a.b=c=d")


def test_a_model_may_be_a_name_or_a_path() -> None:
    _, told = parsed("bag", "--model", "some.onnx", "--labels", "here/labels.txt")
    assert (told["model"], told["labels"]) == ("some.onnx", "here/labels.txt")


def test_a_parameter_file_is_a_path_to_a_file(tmp_path: Path) -> None:
    (tmp_path / "p.yaml").touch()
    assert parsed("bag", "--params", str(tmp_path / "p.yaml"))[1]["params_file"] == tmp_path / "p.yaml"


@pytest.mark.parametrize(("name", "complaint"), [("nowhere.yaml", "No such file"), (".", "got a folder")])
def test_a_parameter_file_that_is_none_is_refused(name: str, complaint: str, tmp_path: Path) -> None:
    with pytest.raises((OSError, ValueError), match=complaint):
        read_settings(parsed("bag", "--params", str(tmp_path / name))[1]["params_file"], ())


def test_a_recording_has_to_be_named() -> None:
    result, told = parsed()
    assert result.exit_code == 2 and "Missing argument 'RECORDING'" in result.output and not told


def test_a_file_that_can_be_written_is_not_touched(tmp_path: Path) -> None:
    require_writable("--out", tmp_path / "new.html")
    assert not (tmp_path / "new.html").exists()
    (tmp_path / "old.html").write_text("old")
    require_writable("--out", tmp_path / "old.html")
    assert (tmp_path / "old.html").read_text() == "old"


def test_a_file_in_no_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a_file").touch()
    for place in (tmp_path / "nowhere/x", tmp_path / "a_file/x"):
        with pytest.raises(OSError, match=r"^--out: expected an existing folder .*, got none; create it or choose"):
            require_writable("--out", place)


def test_a_file_that_may_not_be_written_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "old").touch()
    for forbidden, file in ((tmp_path, tmp_path / "new"), (tmp_path / "old", tmp_path / "old")):
        monkeypatch.setattr("os.access", lambda path, mode, forbidden=forbidden: path != forbidden)  # as root may
        with pytest.raises(OSError, match=r"^--out: expected permission to write .*, got none; choose another"):
            require_writable("--out", file)


def test_a_folder_that_takes_no_file_whatever_its_permissions_say_is_refused_in_one_line(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("os.access", lambda *_: True)  # as root may
    with pytest.raises(
        OSError, match=r"^--out: expected a place that takes a file, got at /proc/x: .*; choose another$"
    ):
        require_writable("--out", Path("/proc/x"))


def test_a_file_that_refuses_to_be_written_is_refused_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(30, "Read-only file system")

    (tmp_path / "old.html").write_text("old")
    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(OSError, match=r"got at .*old\.html: Read-only file system; choose another"):
        require_writable("--out", tmp_path / "old.html")


def test_an_old_file_in_a_folder_that_takes_no_new_one_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "old").touch()
    monkeypatch.setattr("os.access", lambda path, mode: path != tmp_path)  # as root may
    with pytest.raises(OSError, match=r"^--out: expected permission to write .*old, got none"):
        require_writable("--out", tmp_path / "old")


def test_standard_output_is_taken_as_it_is() -> None:
    require_writable("--json", Path("-"))


def test_links_in_a_circle_are_refused_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "circle").symlink_to("circle")
    with pytest.raises(OSError, match=r"^--out: expected a place .*, got at .*circle: Too many levels of symbolic"):
        require_writable("--out", tmp_path / "circle")
