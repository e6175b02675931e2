# SPDX-License-Identifier: Apache-2.0
"""Files that are written whole or not at all."""

from __future__ import annotations

import errno
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import BinaryIO


@contextmanager
def whole_file(path: Path) -> Iterator[BinaryIO]:
    """A binary file that takes the place of ``path`` when the block has ended well; before, it lies beside it.

    Where the block or the disk fails, what was at ``path`` stays as it was. OSError that names ``path`` where it cannot
    be written. A link stays one, and what is no plain file, as a pipe, is written as it is.
    """
    try:
        target = resolved(path)
        if not _is_plain(target):
            with target.open("wb") as file:
                yield file
            return
        with _beside(target) as part, part.open("xb") as file:
            yield file
            file.close()  # here, so that a disk which is full only now keeps the old file
            _replace(target, part)
    except OSError as error:
        raise unwritten(path, error) from error


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a text in UTF-8, or bytes, as `whole_file` does.

    What UTF-8 cannot say, as the name of a file in another encoding, is written as ``?``.
    """
    with whole_file(path) as file:
        file.write(content.encode(errors="replace") if isinstance(content, str) else content)


@contextmanager
def folder_for(path: Path) -> Iterator[Path]:
    """A folder for what makes the file ``path`` by itself, until `put_whole`; beside it where that is a plain file."""
    target = resolved(path)
    with TemporaryDirectory(dir=target.parent if _is_plain(target) else None, prefix=".objreg-") as folder:
        yield Path(folder)


def put_whole(made: Path, path: Path) -> None:
    """Let a finished file, in the folder of `folder_for`, take the place of ``path`` as `whole_file` does."""
    try:
        target = resolved(path)
        if _is_plain(target):
            _replace(target, made)
            return
        with made.open("rb") as file, target.open("wb") as out:
            shutil.copyfileobj(file, out)
    except OSError as error:
        raise unwritten(path, error) from error


def resolved(path: Path) -> Path:
    """Where a path leads through all links; OSError where they go in a circle."""
    target = Path(os.path.realpath(path))
    if target.is_symlink():
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP))
    return target


def unwritten(path: Path | str, error: OSError) -> OSError:
    """What is said where ``path`` could not be written; it is of the same kind as ``error``."""
    why = error.strerror or error
    return type(error)(f"{path}: expected a place that takes it, got: {why}; make room there or choose another")


def _is_plain(target: Path) -> bool:
    """Whether a file can take the place of what is there: nothing, or a plain file."""
    return not target.exists() or target.is_file()


def _replace(target: Path, part: Path) -> None:
    if target.exists():
        shutil.copymode(target, part)
    os.replace(part, target)


@contextmanager
def _beside(target: Path) -> Iterator[Path]:
    """A name for a part of ``target``, in its folder; what is left of it is removed."""
    part = target.with_name(f".objreg-{secrets.token_hex(6)}.part")
    try:
        yield part
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)
