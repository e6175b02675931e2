# SPDX-License-Identifier: Apache-2.0
"""Files that come with a recording: which are opened at all, and their text."""

from __future__ import annotations

import stat
from pathlib import Path

TEXT_BYTES = 1 << 28
"""The longest text that is read: a list of three million pictures."""

SETTINGS_BYTES = 1 << 20
"""The longest text of settings, a thousand times what is usual: YAML takes long."""

KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe (FIFO)"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


def require_regular(file: Path) -> int:
    """The size of a file in bytes. OSError if there is none; ValueError for what is no file, which may never end."""
    status = file.stat()
    if not stat.S_ISREG(status.st_mode):
        got = next((kind for holds, kind in KINDS if holds(status.st_mode)), "something else")
        raise ValueError(f"{file}: expected a regular file, got {got}; put a copy of the file there")
    return status.st_size


def read_text(file: Path, most_bytes: int = TEXT_BYTES) -> str:
    """The text of a file in UTF-8, with or without a byte-order mark.

    ValueError for another encoding, for what is no regular file, and for more than ``most_bytes``.
    """
    size = require_regular(file)
    if size > most_bytes:
        raise ValueError(f"{file}: expected at most {most_bytes} bytes of text, got {size}; is it the right file?")
    try:
        return file.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        got = f"byte 0x{error.object[error.start]:02x} at {error.start}"
        raise ValueError(f"{file}: expected text in UTF-8, got {got}; save it as UTF-8") from error
