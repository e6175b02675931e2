# SPDX-License-Identifier: Apache-2.0
"""Text as a terminal or a log may show it: names, labels and messages of others are data, and never commands to it."""

from __future__ import annotations

import re
import shutil
import sys
import threading
import time
import unicodedata
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any, TextIO

KEPT = "\n\t"
HIDDEN = ("Cc", "Cf", "Cs", "Co", "Zl", "Zp")
"""Categories of Unicode: control, format (as what turns the direction), surrogate, private, line and paragraph."""

BAR = re.compile(r"(\r*)(.*?)(\r*)", re.DOTALL)
"""A write of a progress bar: it returns to the start of its line before or behind its text."""


def printable(text: str) -> str:
    """The text with everything that a terminal would obey, as escape sequences, written out: ESC becomes ``\\x1b``.

    Line ends and tabs stay.
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join(_shown(letter) for letter in text)


def _shown(letter: str) -> str:
    if letter in KEPT or unicodedata.category(letter) not in HIDDEN:
        return letter
    return letter.encode("unicode_escape").decode()


class PlainStream:
    """A stream of text on which everything is `printable`, and that is otherwise ``stream``."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write what of the text is printable; the length of the text. TypeError for bytes."""
        start, middle, end = BAR.fullmatch(text).groups()  # type: ignore[union-attr]
        self._stream.write(f"{start}{printable(middle)}{end}")
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        """Write one after another."""
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def protect_terminal() -> None:
    """From now on standard output and standard error of this process are `PlainStream`s."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is not None and not isinstance(stream, PlainStream):
            setattr(sys, name, PlainStream(stream))


def with_ros2cli(advice: str, otherwise: str) -> str:
    """``advice`` names a command of ros2cli; ``otherwise`` is for where it is not installed: no wheel brings it."""
    return advice if shutil.which("ros2") else otherwise


@contextmanager
def progress(what: str, after_s: float = 1.0) -> Iterator[None]:
    """Say on standard error what is done, where it takes longer than ``after_s``, and at its end how long it took."""
    began, shown = time.monotonic(), threading.Event()

    def show() -> None:
        shown.set()
        _note(f"objreg_ros: {what} …")

    timer = threading.Timer(after_s, show)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()
        if shown.is_set():
            _note(f"objreg_ros: {what}: {time.monotonic() - began:.1f} s")


def _note(line: str) -> None:
    if sys.stderr is not None:  # as behind pythonw
        print(printable(line), file=sys.stderr, flush=True)
