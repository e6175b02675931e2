# SPDX-License-Identifier: Apache-2.0
"""What a process writes outside of its own folders, by the audit events that Python raises before it opens a file.

Libraries in C that open files by themselves raise none.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
CHANGES = {
    "os.remove": ((0, 1),), "os.rmdir": ((0, 1),), "os.mkdir": ((0, 2),), "os.chmod": ((0, 2),),
    "os.rename": ((0, 2), (1, 3)), "os.link": ((1, 3),), "os.symlink": ((1, 2),), "os.truncate": ((0, None),),
    "shutil.rmtree": ((0, 1),), "sqlite3.connect": ((0, None),),
}  # fmt: skip
"""Which arguments of an event are paths that it changes, and which the folder that each is relative to."""
FREE = ("/dev/", "/proc/")
COMPILED = "__pycache__"  # Python keeps what it compiled of a module


class Fence:
    """From now on notes each path outside of ``folders`` that this process writes; a hook that cannot be taken back."""

    def __init__(self, *folders: Path) -> None:
        self._inside = tuple(os.path.realpath(folder) + os.sep for folder in folders)
        self._crossed: list[str] = []
        sys.addaudithook(self._see)

    def crossed(self) -> list[str]:
        """The paths since the last call."""
        found, self._crossed = self._crossed, []
        return found

    def _see(self, event: str, args: tuple[Any, ...]) -> None:
        for path in _written(event, args):
            there = os.path.join(os.path.realpath(os.path.dirname(path)), os.path.basename(path))
            if not f"{there}{os.sep}".startswith((*self._inside, *FREE)) and COMPILED not in there:
                self._crossed.append(there)


def _written(event: str, args: tuple[Any, ...]) -> Iterator[str]:
    if event == "open":
        path, _, flags = args
        if flags & WRITING and not isinstance(path, int):
            yield os.fsdecode(path)
        return
    for at, folder in CHANGES.get(event, ()):
        path, base = args[at], -1 if folder is None or folder >= len(args) else args[folder]
        if isinstance(path, int) or (text := os.fsdecode(path)) in ("", ":memory:") or "mode=ro" in text:
            continue
        yield os.path.join(f"/proc/self/fd/{base}" if base not in (-1, None) else "", text.removeprefix("file:"))
