# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import click
import pytest
from click.testing import CliRunner

from objreg_tools.cli import FOLDER, SUMMARIES, _module, group, main


def test_help_shows_every_command_that_is_there_and_imports_none() -> None:
    code = (
        "import sys; from click.testing import CliRunner; from objreg_tools.cli import group;"
        "print(CliRunner().invoke(group, ['--help']).output);"
        "heavy = {'numpy', 'cv2', 'rosbags', 'rclpy', 'open3d'} & set(sys.modules); assert not heavy, heavy"
    )
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert "offline" in shown and SUMMARIES["offline"] in shown


def test_every_command_has_its_help() -> None:
    for name in [name for name in SUMMARIES if (FOLDER / f"{_module(name)}.py").exists()]:
        result = CliRunner().invoke(group, [name, "--help"])
        assert result.exit_code == 0 and "Usage:" in result.output, name


def test_every_file_of_a_command_is_in_the_list() -> None:
    with_command = [path for path in FOLDER.rglob("*.py") if "\ndef command(" in path.read_text()]
    modules = {".".join(("objreg_tools.cli.commands", *path.relative_to(FOLDER).with_suffix("").parts))
               for path in with_command}  # fmt: skip
    assert len(modules) > 15 and modules <= set(map(_module, SUMMARIES))


def test_an_unknown_command_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main("fly")
    assert end.value.code == 2 and "No such command 'fly'" in capsys.readouterr().err


def test_a_broken_input_is_one_line_and_exit_1(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main("offline", "/nowhere/at/all")
    error = capsys.readouterr().err
    assert end.value.code == 1 and error.count("\n") == 1 and error.startswith("objreg: /nowhere/at/all: no such file")


@pytest.mark.parametrize("said", [SystemExit, RuntimeError])
def test_sigterm_ends_what_was_begun_and_says_so_by_its_status(
    said: type[BaseException], monkeypatch: pytest.MonkeyPatch
) -> None:
    ended = []

    def work(**_: object) -> None:
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(10)
        except SystemExit:
            ended.append(True)
            raise said(143) from None  # as ROS, which the signal shuts down

    before = signal.signal(signal.SIGTERM, signal.SIG_IGN)  # a miss shall not end the tests
    try:
        monkeypatch.setattr(group, "main", work)
        with pytest.raises(SystemExit) as end:
            main("replay")
        assert (end.value.code, ended) == (143, [True])
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGTERM, before)


def test_the_group_is_a_click_group() -> None:
    assert isinstance(group, click.Group)


def test_an_error_of_many_lines_is_reported_in_one(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(**_: object) -> None:
        raise ValueError("expected this,\n  got\tthat")

    monkeypatch.setattr(group, "main", fail)
    with pytest.raises(SystemExit) as end:
        main("offline")
    assert end.value.code == 1 and capsys.readouterr().err == "objreg: expected this, got that\n"


@pytest.mark.parametrize("bug", [MemoryError, RecursionError, OverflowError, TypeError])
def test_a_bug_shows_its_traceback(bug: type[Exception], monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(**_: object) -> None:
        raise bug

    monkeypatch.setattr(group, "main", fail)
    with pytest.raises(bug):
        main("offline")


def completed(*words: str) -> list[str]:
    """What a tab brings behind words, of which the last is not whole."""
    from click.shell_completion import ShellComplete

    completion = ShellComplete(group, {}, "objreg", "_OBJREG_COMPLETE")
    return [item.value for item in completion.get_completions(list(words[:-1]), words[-1])]


def test_a_tab_completes_commands_and_options() -> None:
    assert completed("in") == ["inspect"] and set(completed("")) >= {"demo", "doctor", "fetch-model"}
    assert completed("--ver") == ["--version", "--verbose"] and completed("offline", "--ma") == [
        "--map",
        "--max-frames",
    ]


def test_a_tab_behind_no_command_imports_none() -> None:
    code = (
        "import sys; from objreg_tools.cli import main\n"
        "try: main()\nfinally: assert not {'numpy', 'cv2', 'rosbags'} & set(sys.modules)"
    )
    asked = {"_OBJREG_COMPLETE": "bash_complete", "COMP_WORDS": "objreg rep", "COMP_CWORD": "1"}
    shown = subprocess.run([sys.executable, "-c", code], env={**os.environ, **asked}, capture_output=True, text=True)
    assert shown.stdout.split() == ["plain,replay", "plain,report"] and not shown.stderr


def test_a_broken_input_shows_where_it_was_met_if_that_is_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main("-v", "inspect", "/nowhere/at/all")
    said = capsys.readouterr().err
    assert said.startswith("Traceback") and said.splitlines()[-1].startswith("objreg: /nowhere/at/all: no such file")


def test_an_error_is_reported_although_all_else_is_hushed(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main("-q", "inspect", "/nowhere/at/all")
    assert end.value.code == 1 and capsys.readouterr().err.startswith("objreg: /nowhere/at/all: no such file")
