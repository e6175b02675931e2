# SPDX-License-Identifier: Apache-2.0
"""Text files that come with a recording."""

from __future__ import annotations

from pathlib import Path


def read_text(file: Path) -> str:
    """The text of a file in UTF-8, with or without a byte-order mark; ValueError for another encoding."""
    try:
        return file.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        got = f"byte 0x{error.object[error.start]:02x} at {error.start}"
        raise ValueError(f"{file}: expected text in UTF-8, got {got}; save it as UTF-8") from error
