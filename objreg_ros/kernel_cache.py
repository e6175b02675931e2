# SPDX-License-Identifier: Apache-2.0
"""Where compiled kernels are kept if numba finds no place: installed read-only, without a home that can be written."""

from __future__ import annotations

import atexit
import os
import shutil
import stat
import tempfile
from collections.abc import MutableMapping
from contextlib import suppress
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"
PACKAGE = Path(__file__).resolve().parent
SHARED_MEMORY = Path("/dev/shm")  # can be written in a container whose own files are read-only


def settle(environment: MutableMapping[str, str]) -> None:
    """Name a folder of this user's among the temporary files, if there is no better one. Before numba is imported.

    What lies in it is run: where another user could have filled it, a new folder lasts as long as this process. Where
    nothing at all can be written, nothing happens.
    """
    chosen = [Path(environment[VARIABLE])] if environment.get(VARIABLE) else []
    if any(map(_is_writable, (*chosen, PACKAGE / "__pycache__", _user_cache(environment)))):
        return
    folder = _own_folder() or _new_folder()
    if folder is not None:
        environment[VARIABLE] = str(folder)


def _own_folder() -> Path | None:
    """The folder that the next process of this user finds again; None where it cannot be made, or is not safe."""
    with suppress(OSError):  # no temporary folder
        folder = Path(tempfile.gettempdir()) / f"objreg_kernels_{os.getuid()}"
        folder.mkdir(mode=0o700, exist_ok=True)
        status = folder.lstat()
        if stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not status.st_mode & 0o022:
            return folder
    return None


def _new_folder() -> Path | None:
    """A folder that goes with this process; None where none can be made."""
    for parent in (None, SHARED_MEMORY):
        with suppress(OSError):
            folder = tempfile.mkdtemp(prefix="objreg_kernels_", dir=parent)
            atexit.register(shutil.rmtree, folder, ignore_errors=True)
            return Path(folder)
    return None


def _user_cache(environment: MutableMapping[str, str]) -> Path:
    """The folder that numba takes where it cannot write beside the code."""
    home = environment.get("HOME") or str(Path(os.sep))
    return Path(environment.get("XDG_CACHE_HOME") or Path(home, ".cache")) / "numba"


def _is_writable(folder: Path) -> bool:
    """Whether it can be written, or made."""
    there = next((path for path in (folder, *folder.parents) if path.exists()), None)
    return there is not None and os.access(there, os.W_OK)
