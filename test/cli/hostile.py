# SPDX-License-Identifier: Apache-2.0
"""Files that somebody made to hang or to end a command, and a process that calls the command with each of them."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import cv2
import numpy as np
from recording.sample_folders import records, tum_folder
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from objreg_tools.recording import write_rosbag2
from objreg_tools.recording.rosbag.messages import standard_types

DEEP = 100_000
PATIENCE_S = 240

CALLS = """
import contextlib, io, json, signal, sys, traceback
from objreg_tools.cli import main

def late(*_):
    raise BaseException("it takes more than a minute")

signal.signal(signal.SIGALRM, late)
ended = {}
for name, words in json.load(sys.stdin).items():
    out, err, code = io.StringIO(), io.StringIO(), 0
    signal.alarm(60)
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            main(*words)
    except SystemExit as end:
        code = end.code
    except BaseException:
        code = traceback.format_exc()
    signal.alarm(0)
    ended[name] = (code, err.getvalue())
print("ENDED" + json.dumps(ended))
"""


def call_each(calls: Mapping[str, list[str]], cwd: Path) -> dict[str, tuple[object, str]]:
    """By the name of a call its exit status (or its traceback) and what it said on stderr."""
    command = [sys.executable, "-c", CALLS]
    done = subprocess.run(
        command, input=json.dumps(calls), capture_output=True, text=True, timeout=PATIENCE_S, cwd=cwd, check=False
    )
    assert "ENDED" in done.stdout, done.stderr[-3000:]
    return {name: (code, err) for name, (code, err) in json.loads(done.stdout.partition("ENDED")[2]).items()}


def hostile_files(folder: Path, suffix: str, good: bytes = b"") -> dict[str, Path]:
    """Files of a suffix that nothing can read, each by what is wrong with it; ``good`` is one that can be."""
    contents = {
        "empty": b"",
        "text": b"hello\n" * 1000,
        "deep JSON": b'{"constraints": ' + b"[" * DEEP,
        "deep YAML": b"a: " + b"[" * DEEP,
        "a huge number": b"a: " + b"9" * DEEP,
        "zeros": bytes(5000),
    }
    if good:
        contents |= {"half": good[: len(good) // 2], "huge size": good[:13] + b"\xff" * 6 + b"\x7f" + good[20:]}
    made = {}
    for name, content in contents.items():
        made[name] = folder / f"{name.replace(' ', '_')}{suffix}"
        made[name].write_bytes(content)
    made["folder"] = folder / f"folder{suffix}"
    made["folder"].mkdir()
    made["pipe"] = folder / f"pipe{suffix}"
    os.mkfifo(made["pipe"])
    made["device"] = folder / f"device{suffix}"
    made["device"].symlink_to("/dev/zero")
    made["link to nothing"] = folder / f"nothing{suffix}"
    made["link to nothing"].symlink_to("nowhere")
    return made


def hostile_recordings(folder: Path) -> dict[str, Path]:
    """Recordings of every kind that cannot be read."""
    made: dict[str, Path] = {}
    for storage, suffix in (("mcap", ".mcap"), ("sqlite3", ".db3")):
        good = folder / f"good_{storage}"
        write_rosbag2(good, records(), storage)
        (file,) = good.glob(f"*{suffix}")
        files = hostile_files(_made(folder / storage), suffix, file.read_bytes())
        made |= {f"{name}{suffix}": path for name, path in files.items()}
    made |= {f"{name}.bag": path for name, path in hostile_files(_made(folder / "bags"), ".bag").items()}
    made |= _hostile_folders(folder)
    return made


def _hostile_folders(folder: Path) -> dict[str, Path]:
    changes: dict[str, tuple[str, Callable[[Path], object]]] = {
        "deep metadata": ("metadata.yaml", lambda file: file.write_text("a: " + "[" * DEEP)),
        "pipe as metadata": ("metadata.yaml", os.mkfifo),
        "deep camera": ("camera.yaml", lambda file: file.write_text("a: " + "[" * DEEP)),
        "pipe as camera": ("camera.yaml", os.mkfifo),
        "pipe as list": ("associations.txt", os.mkfifo),
        "pipe as picture": ("rgb/0.000000.png", os.mkfifo),
        "device as list": ("associations.txt", lambda file: file.symlink_to("/dev/zero")),
        "list of elsewhere": ("associations.txt", lambda file: file.write_text("0 /etc/passwd 0 /etc/passwd")),
        "list that climbs": ("associations.txt", lambda file: file.write_text("0 ../../etc/passwd 0 ../x")),
        "binary list": ("associations.txt", lambda file: file.write_bytes(bytes(range(256)))),
    }
    made = {}
    for name, (file, change) in changes.items():
        place = made[name] = folder / name.replace(" ", "_")
        if file == "metadata.yaml":
            shutil.copytree(folder / "good_mcap", place)
        else:
            tum_folder(place)
        (place / file).unlink()
        change(place / file)
    made["bomb"] = _bomb(folder / "bomb")
    return made


def _bomb(path: Path) -> Path:
    """A rosbag2 of some kilobytes that would become three gigabytes."""
    writer = Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3)
    writer.set_compression(CompressionMode.FILE, CompressionFormat.ZSTD)
    with writer:
        for record in records(1):
            connection = writer.add_connection(record.topic, record.msgtype, typestore=standard_types())
            writer.write(connection, record.stamp_ns, record.cdr)
    (file,) = (file for file in path.iterdir() if file.suffix != ".yaml")
    block = (1 << 17) << 3 | 1 << 1  # a byte that is repeated 2^17 times
    last = block | 1
    blocks = 24_000 * (block.to_bytes(3, "little") + b"\0") + last.to_bytes(3, "little") + b"\0"
    file.write_bytes(b"\x28\xb5\x2f\xfd" + bytes([0, 0x58]) + blocks)
    return path


def _made(folder: Path) -> Path:
    folder.mkdir()
    return folder


def good_folder(path: Path) -> Path:
    """A TUM RGB-D folder of grey, that every command reads."""
    folder = tum_folder(path)
    cv2.imwrite(str(folder / "rgb/0.000000.png"), np.zeros((48, 64, 3), np.uint8))
    return folder
