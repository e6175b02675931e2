# SPDX-License-Identifier: Apache-2.0
"""Files that are written whole or not at all."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO


@contextmanager
def whole_file(path: Path) -> Iterator[BinaryIO]:
    """A binary file that takes the place of ``path`` when the block has ended well; before, it lies beside it.

    Where the block or the disk fails, what was at ``path`` stays as it was. OSError that names ``path`` where it cannot
    be written. A link stays one, and what is no plain file, as a pipe, is written as it is.
    """
    target = path.resolve()
    try:
        if target.exists() and not target.is_file():
            with target.open("wb") as file:
                yield file
            return
        with _beside(target) as part, part.open("xb") as file:
            yield file
            file.close()  # here, so that a disk which is full only now keeps the old file
            if target.exists():
                shutil.copymode(target, part)
            os.replace(part, target)
    except OSError as error:
        raise unwritten(path, error) from error


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a text in UTF-8, or bytes, as `whole_file` does."""
    with whole_file(path) as file:
        file.write(content.encode() if isinstance(content, str) else content)


def unwritten(path: Path | str, error: OSError) -> OSError:
    """What is said where ``path`` could not be written; it is of the same kind as ``error``."""
    why = error.strerror or error
    return type(error)(f"{path}: expected a place that takes it, got: {why}; make room there or choose another")


@contextmanager
def _beside(target: Path) -> Iterator[Path]:
    """A name for a part of ``target``, in its folder; what is left of it is removed."""
    part = target.with_name(f".objreg-{secrets.token_hex(6)}.part")
    try:
        yield part
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)
