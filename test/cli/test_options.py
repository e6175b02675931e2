# SPDX-License-Identifier: Apache-2.0
"""What the shared options make of the words of a command line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import CliRunner, Result

from objreg_tools.cli import options
from objreg_tools.cli.settings import read_settings


def parsed(*words: str) -> tuple[Result, dict[str, Any]]:
    """What became of a command with all the options, and what it was given."""
    given: dict[str, Any] = {}

    @click.command()
    @options.recording
    @options.remap
    @options.params
    @options.change
    @options.model
    @options.labels
    def command(**asked: Any) -> None:
        given.update(asked)

    return CliRunner().invoke(command, words), given


def test_without_options_nothing_is_asked_for() -> None:
    result, given = parsed("some/bag")
    assert result.exit_code == 0 and given == {
        "recording": Path("some/bag"), "remaps": (), "params_file": None, "changes": (), "model": None, "labels": None,
    }  # fmt: skip


def test_remaps_and_changes_come_in_their_order_as_often_as_they_are_said() -> None:
    _, given = parsed(
        "bag", "--set", "registrar.seed=4", "--remap", "odom:=/o", "--remap", "depth:=", "--set", "a.b=c=d"
    )
    assert given["remaps"] == ("odom:=/o", "depth:=") and given["changes"] == ("registrar.seed=4", "a.b=c=d")


def test_a_model_may_be_a_name_or_a_path() -> None:
    _, given = parsed("bag", "--model", "some.onnx", "--labels", "here/labels.txt")
    assert (given["model"], given["labels"]) == ("some.onnx", "here/labels.txt")


def test_a_parameter_file_is_a_path_to_a_file(tmp_path: Path) -> None:
    (tmp_path / "p.yaml").touch()
    assert parsed("bag", "--params", str(tmp_path / "p.yaml"))[1]["params_file"] == tmp_path / "p.yaml"


@pytest.mark.parametrize(("name", "complaint"), [("nowhere.yaml", "No such file"), (".", "got a folder")])
def test_a_parameter_file_that_is_none_is_refused(name: str, complaint: str, tmp_path: Path) -> None:
    with pytest.raises((OSError, ValueError), match=complaint):
        read_settings(parsed("bag", "--params", str(tmp_path / name))[1]["params_file"], ())


def test_a_recording_has_to_be_named() -> None:
    result, given = parsed()
    assert result.exit_code == 2 and "Missing argument 'RECORDING'" in result.output and not given
