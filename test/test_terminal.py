# SPDX-License-Identifier: Apache-2.0
"""What others named reaches no terminal as a command to it: every stream of the command and of the nodes is plain."""

from __future__ import annotations

import io
import os
import pty
import re
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore
from tqdm import tqdm

from objreg_ros.terminal import PlainStream, printable, progress, protect_terminal, with_ros2cli

HOSTILE = "cup\x1b[2J\x1b]0;title\x07\x00\x9b31m\u202e"
SHOWN = r"cup\x1b[2J\x1b]0;title\x07\x00\x9b31m\u202e"


def test_what_a_terminal_would_obey_is_written_out() -> None:
    assert printable(HOSTILE) == SHOWN and printable(SHOWN) == SHOWN
    assert printable("over\rwritten\x7f\b\u2028\ud800") == r"over\rwritten\x7f\x08\u2028\ud800"


@pytest.mark.parametrize("text", ["", "plain", "two\nlines\tand a tab\n", "Tasse, 杯, 5°, – …, é, \xa0"])
def test_other_text_stays_as_it_is(text: str) -> None:
    assert printable(text) == text


def test_a_stream_writes_what_is_printable_and_is_otherwise_the_stream_itself() -> None:
    inner = io.StringIO()
    stream = PlainStream(inner)
    assert stream.write(HOSTILE) == len(HOSTILE)
    stream.writelines(["\n", "\x1b"])
    assert inner.getvalue() == f"{SHOWN}\n\\x1b" and not stream.isatty()
    with pytest.raises(TypeError):
        stream.write(b"bytes")  # type: ignore[arg-type]


def test_a_progress_bar_still_returns_to_the_start_of_its_line() -> None:
    inner = io.StringIO()
    with tqdm(total=2, desc=HOSTILE, file=PlainStream(inner), ncols=80, mininterval=0) as bar:
        bar.update()
    assert inner.getvalue().startswith("\r") and "\x1b" not in inner.getvalue() and SHOWN in inner.getvalue()


def test_streams_are_protected_once(monkeypatch: pytest.MonkeyPatch) -> None:
    out = io.StringIO()
    monkeypatch.setattr("sys.stdout", out)
    monkeypatch.setattr("sys.stderr", None)  # as behind pythonw
    protect_terminal()
    protected = sys.stdout
    protect_terminal()
    assert sys.stdout is protected and isinstance(protected, PlainStream) and sys.stderr is None


@pytest.mark.parametrize(("found", "advice"), [("/bin/ros2", "`ros2 topic list`"), (None, "the log")])
def test_a_command_of_ros2cli_is_advised_where_it_is_installed(
    found: str | None, advice: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("shutil.which", lambda name: found)
    assert with_ros2cli("`ros2 topic list`", "the log") == advice


def test_what_takes_long_is_named_with_its_time_and_what_does_not_is_silent(capsys: pytest.CaptureFixture[str]) -> None:
    with progress("reading a cup", after_s=60):
        pass
    assert capsys.readouterr() == ("", "")
    with progress(f"reading {HOSTILE}", after_s=0.01):
        time.sleep(0.2)
    began, ended = capsys.readouterr().err.splitlines()
    assert began == f"objreg_ros: reading {SHOWN} …" and re.fullmatch(r"objreg_ros: reading .*: 0\.[2-9] s", ended)


def test_an_error_in_what_is_done_is_raised_and_nothing_is_said_later(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ValueError, match="no cup"), progress("reading", after_s=0.1):
        raise ValueError("no cup")
    time.sleep(0.2)
    assert capsys.readouterr().err == ""


def hostile_bag(path: Path) -> Path:
    types = get_typestore(Stores.ROS1_NOETIC)
    with Writer(path) as writer:
        connection = writer.add_connection(f"/{HOSTILE}", "std_msgs/msg/String", typestore=types)
        message = types.types["std_msgs/msg/String"](data=HOSTILE)
        writer.write(connection, 1, types.serialize_ros1(message, "std_msgs/msg/String"))
    return path


def in_terminal(command: list[str]) -> str:
    """What a process writes to a terminal."""
    ours, theirs = pty.openpty()
    said = bytearray()
    with subprocess.Popen(command, stdout=theirs, stderr=theirs, stdin=subprocess.DEVNULL):
        os.close(theirs)
        with suppress(OSError):  # its other end is closed
            while chunk := os.read(ours, 1 << 16):
                said += chunk
    os.close(ours)
    return said.decode()


@pytest.mark.parametrize("module", ["objreg_tools", "objreg_tools.cli"])
@pytest.mark.parametrize("words", [["inspect"], ["offline"], ["-v", "offline"], ["convert"]], ids=" ".join)
def test_the_command_shows_names_of_a_recording_without_obeying_them(
    module: str, words: list[str], tmp_path: Path
) -> None:
    bag = hostile_bag(tmp_path / "some\x1b[31m.bag")
    command = [sys.executable, "-m", module, *words, str(bag)]
    command += [str(tmp_path / "out")] if words == ["convert"] else []
    said = in_terminal(command)
    assert r"\x1b[2J" in said and r"\u202e" in said
    assert not set("\x1b\x00\x07\x9b\u202e") & set(said)
