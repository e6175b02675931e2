# SPDX-License-Identifier: Apache-2.0
"""Where compiled kernels are kept if numba finds no place: installed read-only, without a home that can be written."""

from __future__ import annotations

import os
import stat
import tempfile
from collections.abc import MutableMapping
from contextlib import suppress
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"
PACKAGE = Path(__file__).resolve().parent


def settle(environment: MutableMapping[str, str]) -> None:
    """Name a folder of this user's among the temporary files, if there is no better one. Before numba is imported.

    Nothing happens where that cannot be made either, or is another user's: what lies in it is run.
    """
    if environment.get(VARIABLE) or any(map(_is_writable, (PACKAGE / "__pycache__", _user_cache(environment)))):
        return
    with suppress(OSError):  # no temporary folder
        folder = Path(tempfile.gettempdir()) / f"objreg_kernels_{os.getuid()}"
        folder.mkdir(mode=0o700, exist_ok=True)
        status = folder.lstat()
        if stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not status.st_mode & 0o022:
            environment[VARIABLE] = str(folder)


def _user_cache(environment: MutableMapping[str, str]) -> Path:
    """The folder that numba takes where it cannot write beside the code."""
    home = environment.get("HOME") or str(Path(os.sep))
    return Path(environment.get("XDG_CACHE_HOME") or Path(home, ".cache")) / "numba"


def _is_writable(folder: Path) -> bool:
    """Whether it can be written, or made."""
    there = next((path for path in (folder, *folder.parents) if path.exists()), None)
    return there is not None and os.access(there, os.W_OK)
