# SPDX-License-Identifier: Apache-2.0
"""The command line under attack: outputs that are inputs by some other name, and downloads from a hostile server."""

from __future__ import annotations

import hashlib
import itertools
import os
import random
import shutil
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from functools import partial
from http.client import HTTPException
from pathlib import Path
from typing import Any

import click
from attacked_files import borrowed, write_store
from click.testing import CliRunner
from trials import PATIENCE_S, Attempt, LateError, OutsideError, Target, WrongAnswerError

from objreg_tools.cli import download as downloads
from objreg_tools.cli import group
from objreg_tools.cli.commands.fetch_model import command as fetch_model
from objreg_tools.cli.paths import OutputPath

# -------------------------------------------------------------------------------------------------------------- outputs

OFFLINE = group.get_command(click.Context(group), "offline")
FILES = [p.opts[0] for p in OFFLINE.params if isinstance(p.type, OutputPath)] if OFFLINE else []  # its outputs
RECORDED = "walk"


class Inputs:
    """A folder of all that commands read, and what it held at first."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir()
        recording = borrowed("recording/sample_folders.py").tum_folder(folder / RECORDED, frames=2)
        self.recording = Path(recording)
        self.store, self.run, self.settings = folder / "place.db", folder / "run.json", folder / "settings.yaml"
        write_store(self.store)
        self.settings.write_text("registrar:\n  ros__parameters:\n    seed: 3\n")
        result = CliRunner().invoke(group, ["offline", str(self.recording), "--json", str(self.run)])
        if result.exit_code:
            raise RuntimeError(f"the run that is to be attacked fails: {result.output}") from result.exception
        self.whole = contents(folder)

    def restore(self) -> None:
        """As it was at first."""
        shutil.rmtree(self.folder)
        for path, content in self.whole.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)

    def require_whole(self) -> None:
        """OutsideError where anything is not as it was at first; that is restored."""
        now = contents(self.folder)
        changed = [path for path in self.whole.keys() | now.keys() if now.get(path) != self.whole.get(path)]
        if changed:
            self.restore()
            raise OutsideError(f"{changed[0].relative_to(self.folder)} was written over, made or removed")


def contents(folder: Path) -> dict[Path, bytes]:
    """The bytes of every file below a folder."""
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def outputs_attempt(folder: Path, commands: Any = group) -> Attempt:
    """Commands whose outputs are their inputs: what they read stays as it is, and the command fails."""
    inputs, free, number = Inputs(folder / "inputs"), folder / "free", itertools.count()
    free.mkdir()

    def attempt(draw: random.Random) -> None:
        disguise = partial(disguised, draw, free / str(next(number)))
        words, apart = command_line(draw, inputs, disguise)
        result = CliRunner().invoke(commands, [str(word) for word in words], standalone_mode=False)
        inputs.require_whole()
        if apart and result.exception is not None:
            raise WrongAnswerError(f"{words[0]} fails without an attack: {result.exception}") from result.exception
        if not apart and result.exception is None:
            raise WrongAnswerError(f"{' '.join(map(str, words))}: ends as if all were well")
        if result.exception is not None:
            raise result.exception

    return attempt


def command_line(draw: random.Random, inputs: Inputs, disguise: Callable[[Path], Path]) -> tuple[list[Any], bool]:
    """Words of a command, and whether its output is apart from all that it reads: the attack has to be able to fail."""
    apart = draw.random() < 0.1
    target = inputs.folder.parent / "free" / "out" if apart else None
    if draw.random() < 0.4:
        option = draw.choice(("--page", "--picture")) if not apart else "--page"
        attacked = inputs.store if draw.random() < 0.7 else inputs.store.with_name("place.db-wal")
        return ["inspect", inputs.store, option, target or disguise(attacked)], apart
    if apart or draw.random() < 0.3:
        return ["report", inputs.run, "--out", target or disguise(inputs.run)], apart
    read = {inputs.recording: [], inputs.settings: ["--params", inputs.settings]}
    read[inputs.store] = ["--set", f"registrar.store={inputs.store}"]
    attacked = draw.choice(list(read))
    if draw.random() < 0.2:
        out = disguise(inputs.folder.parent / "free" / "twice")
        one, other = draw.sample(FILES, 2)
        return ["offline", inputs.recording, one, out, other, out.parent / "." / out.name], False
    place = attacked / draw.choice(("rgb.txt", "new.txt", "rgb/new.png")) if attacked == inputs.recording else attacked
    return ["offline", inputs.recording, *read[attacked], draw.choice(FILES), disguise(place)], False


def disguised(draw: random.Random, folder: Path, file: Path) -> Path:
    """Another name of a file, by links and detours in an empty folder."""
    folder.mkdir()
    how = draw.choice(("itself", "detour", "relative", "link", "folder", "links", "hard"))
    if how == "detour":
        return file.parent / "nowhere" / ".." / file.name
    if how == "relative":
        return Path(os.path.relpath(file))
    if how == "link":
        (folder / "link").symlink_to(file)
        return folder / "link"
    if how == "folder":
        (folder / "link").symlink_to(file.parent, target_is_directory=True)
        return folder / "link" / file.name
    if how == "links":
        (folder / "b").symlink_to(os.path.relpath(file, folder))
        (folder / "a").symlink_to("b")
        return folder / "a"
    if how == "hard" and file.is_file():
        (folder / "hard").hardlink_to(file)
        return folder / "hard"
    return file


# ------------------------------------------------------------------------------------------------------------ downloads

OK = b"HTTP/1.1 200 OK\r\nContent-Type: application/octet-stream\r\n"
MOST_BYTES = 4 << 20
PATHS = (
    "some.onnx", "../some.onnx", "..%2fsome.onnx", "%2e%2e/x.onnx", "a/../../x.onnx", ".onnx", "a\\..\\x.onnx",
    "some.onnx?x=/../y.onnx", "some.onnx#/../y.onnx", "x%00.onnx", "n" * 300 + ".onnx", "/etc/x.onnx", "%0a.onnx",
)  # fmt: skip
Answer = Callable[[random.Random, socket.socket, str], None]


def _send(draw: random.Random, connection: socket.socket, _: str) -> None:
    content = draw.randbytes(draw.choice((0, 1, 1000, 100_000)))
    length = draw.choice((len(content), len(content) + 1, max(len(content) - 1, 0), 10**30, -1))
    connection.sendall(OK + b"Content-Length: %d\r\n\r\n" % length + content)


def _lead(draw: random.Random, connection: socket.socket, own: str) -> None:
    """A redirect, to itself for ever or to where nobody may be led."""
    port = own.rpartition(":")[2]
    target = draw.choice((
        f"{own}/some.onnx", "/some.onnx", f"ftp://127.0.0.1:{port}/some.onnx", "file:///etc/passwd", "data:,x", "",
        f"https://127.0.0.1:{port}/x.onnx", "//", "http://[", "javascript:1", "http://127.0.0.1:99999/x", "\x00",
    ))  # fmt: skip
    code = draw.choice((301, 302, 303, 307, 308, 300, 304))
    response = f"HTTP/1.1 {code} Found\r\nLocation: {target}\r\nContent-Length: {draw.choice((0, 10**12))}\r\n\r\n"
    connection.sendall(response.encode())


def _drip(draw: random.Random, connection: socket.socket, _: str) -> None:
    """Little by little, in the head or in the body."""
    before, each = draw.choice(((OK, b"X-Y: z\r\n"), (b"HTTP", b" "), (OK + b"\r\n", b"x"), (OK, b"")))
    connection.sendall(before)
    while True:
        connection.sendall(each)
        time.sleep(0.05)


def _pour(draw: random.Random, connection: socket.socket, _: str) -> None:
    """Without end, as fast as it goes: body, chunks, head."""
    before, each = draw.choice((
        (OK + b"\r\n", bytes(1 << 16)), (OK + b"Transfer-Encoding: chunked\r\n\r\n", b"1\r\nx\r\n" * 4096),
        (OK, b"X: " + b"y" * (1 << 16)), (OK, b"X: y\r\n" * 1000), (b"HTTP/1.1 100 Continue\r\n\r\n" * 1000, b"\r\n"),
    ))  # fmt: skip
    connection.sendall(before)
    while True:
        connection.sendall(each)


def _babble(draw: random.Random, connection: socket.socket, _: str) -> None:
    """What is no answer, or one to another question."""
    response = draw.choice((
        b"", b"\0" * 100, b"HTTP/9.9 999 ?\r\n\r\n", b"HTTP/1.1 200\r\n\r\nx", draw.randbytes(500),
        b"HTTP/1.1 416 No\r\nContent-Length: 0\r\n\r\n", b"HTTP/1.1 401 No\r\nWWW-Authenticate: Basic\r\n\r\n",
        b"HTTP/1.1 206 Partial\r\nContent-Range: bytes 7-9/10\r\nContent-Length: 3\r\n\r\nabc",
        OK + b"Content-Encoding: gzip\r\nContent-Length: 3\r\n\r\nabc",
        OK + b"Content-Disposition: attachment; filename=/tmp/x.onnx\r\nContent-Length: 3\r\n\r\nabc",
        OK + b"Transfer-Encoding: chunked\r\n\r\nFFFFFFFFFFFFFFFFF\r\n",
    ))  # fmt: skip
    connection.sendall(response)


ANSWERS: tuple[Answer, ...] = (_send, _lead, _lead, _drip, _pour, _babble, _babble)


class Hostile:
    """A server that answers each question as the dice say, for one trial."""

    def __init__(self, draw: random.Random, answers: tuple[Answer, ...] = ANSWERS) -> None:
        self._draw, self._answers, self._open = draw, answers, list[socket.socket]()
        self._socket = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self._socket.getsockname()[1]}"
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        with suppress(OSError):
            while True:
                connection, _ = self._socket.accept()
                self._open.append(connection)
                seed = self._draw.random()
                threading.Thread(target=self._talk, args=(connection, random.Random(seed)), daemon=True).start()

    def _talk(self, connection: socket.socket, draw: random.Random) -> None:
        with suppress(OSError), connection:
            connection.recv(1 << 16)
            draw.choice(self._answers)(draw, connection, self.url)

    def close(self) -> None:
        """End all connections."""
        for one in (self._socket, *self._open):
            with suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)
            one.close()


@contextmanager
def hasty(bounds: Mapping[str, float]) -> Iterator[None]:
    """The bounds of a download, so small that each can be met in a trial."""
    kept = {name: getattr(downloads, name) for name in bounds}
    try:
        for name, value in bounds.items():
            setattr(downloads, name, value)
        yield
    finally:
        for name, value in kept.items():
            setattr(downloads, name, value)


BOUNDS = {"SILENCE_S": 1.0, "GRACE_S": 0.5, "MOST_S": 1.5, "MOST_BYTES": MOST_BYTES}


def download_attempt(folder: Path, answers: tuple[Answer, ...] = ANSWERS) -> Attempt:
    """`objreg fetch-model` from a hostile server: it ends in time, and keeps nothing that is not what was asked for."""
    models, number = folder / "models", itertools.count()

    def attempt(draw: random.Random) -> None:
        place = models / str(next(number))
        wanted = draw.choice((hashlib.sha256(b"abc").hexdigest(), "0" * 64, "", "not a checksum"))
        with closing(Hostile(draw, answers)) as server, hasty(BOUNDS):
            words = [f"{server.url}/{draw.choice(PATHS)}", "--folder", str(place), "--sha256", wanted]
            began = time.monotonic()
            result = CliRunner().invoke(fetch_model, words, standalone_mode=False)
            spent = time.monotonic() - began
        require_kept(place, wanted)
        shutil.rmtree(place, ignore_errors=True)
        if spent > PATIENCE_S:
            raise LateError(f"a download with {BOUNDS['MOST_S']} s in all takes {spent:.1f} s")
        if isinstance(result.exception, HTTPException):
            raise RuntimeError(f"an error of HTTP comes through: {result.exception}") from result.exception
        if result.exception is not None:
            raise result.exception

    return attempt


def require_kept(place: Path, wanted: str) -> None:
    """WrongAnswerError for a model that is not what was asked for, or for parts that are too large."""
    for file in place.rglob("*") if place.is_dir() else ():
        if file.is_file() and file.suffix == ".onnx" and hashlib.sha256(file.read_bytes()).hexdigest() != wanted:
            raise WrongAnswerError(f"{file.name} was kept, and has not the checksum that was asked for")
        if file.is_file() and file.stat().st_size > MOST_BYTES:
            raise WrongAnswerError(f"{file.name} was kept, with {file.stat().st_size} bytes")


TARGETS = [Target("outputs", outputs_attempt, 1.5), Target("download", download_attempt)]
