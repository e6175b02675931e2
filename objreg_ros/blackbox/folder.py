# SPDX-License-Identifier: Apache-2.0
"""The folder of the files: bounded, the oldest go. What is not of the black box is never touched."""

from __future__ import annotations

import re
from contextlib import suppress
from pathlib import Path

from objreg_ros.whole_file import unwritten

NAME = "objreg-{stamp}-{what}.mcap"
OURS = re.compile(r"objreg-\d{10}\.\d{9}-[a-z_]+(-\d+)?\.mcap")
PARAMETERS = ".yaml"  # beside each file, under its name


class Folder:
    """Where files go, at most ``most_bytes`` together. OSError, with the path, where it cannot be made."""

    def __init__(self, path: Path, most_bytes: int) -> None:
        self.path, self._most_bytes = path, most_bytes
        self.removed = 0

    def new_file(self, stamp_ns: int, what: str, nbytes: int) -> Path:
        """A name that is free, of the stamp and of what happened; the oldest files have made room for ``nbytes``.

        OSError where the folder cannot be made.
        """
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise unwritten(self.path, error) from error
        self._make_space(nbytes)
        stamp = f"{stamp_ns // 1_000_000_000:010d}.{stamp_ns % 1_000_000_000:09d}"
        path, count = self.path / NAME.format(stamp=stamp, what=what), 1
        while path.exists():
            count += 1
            path = self.path / NAME.format(stamp=stamp, what=f"{what}-{count}")
        return path

    def files(self) -> list[Path]:
        """The files of the black box, the oldest first by when they were written."""
        ages = list[tuple[int, str, Path]]()
        for path in self.path.glob("*.mcap"):
            with suppress(OSError):  # one that somebody takes away meanwhile
                if OURS.fullmatch(path.name) and path.is_file() and not path.is_symlink():
                    ages.append((path.stat().st_mtime_ns, path.name, path))
        return [path for *_, path in sorted(ages)]

    def nbytes(self) -> int:
        """What they hold together."""
        return sum(map(_size, self.files()))

    def _make_space(self, nbytes: int) -> None:
        files = self.files()
        total = nbytes + sum(map(_size, files))
        while files and total > self._most_bytes:
            oldest = files.pop(0)
            total -= _size(oldest)
            for path in (oldest, oldest.with_suffix(PARAMETERS)):
                path.unlink(missing_ok=True)
            self.removed += 1


def _size(path: Path) -> int:
    with suppress(OSError):
        return path.stat().st_size
    return 0
