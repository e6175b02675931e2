# SPDX-License-Identifier: Apache-2.0
"""One registrar for a store: two would give the same ids to different things.

Our own few lines, as rosdep has no key for the library that has them, `filelock`.
"""

from __future__ import annotations

import fcntl
import os
from contextlib import suppress
from pathlib import Path

from objreg_ros.registrar.store_file import StoreError


class Claim:
    """The store at ``path``, kept to one holder until `release`, or until its process ends, however it ends.

    StoreError if another one has it. What is locked is a file beside the store: on the store itself are SQLite's own
    locks, which a program that only reads needs too.
    """

    def __init__(self, path: Path) -> None:
        real = path.resolve()  # by whatever name it is called
        self._path, self._beside = path, real.with_name(f"{real.name}.lock")
        self._process, self._descriptor = os.getpid(), -1
        try:
            while self._descriptor < 0:
                self._descriptor = self._tried()
        except BlockingIOError:
            raise StoreError(
                f"{path}: in use by another registrar: expected a store that nobody else writes, got one of process "
                f"{self._holder()}; end that, or use another path"
            ) from None
        except OSError as error:
            raise StoreError(f"{path}: cannot keep it from other registrars by {self._beside}: {error}") from error
        with suppress(OSError):  # a full disk: the number is only for the refusal of others
            os.truncate(self._descriptor, 0)
            os.write(self._descriptor, f"{self._process}\n".encode())

    def release(self) -> None:
        """Let others have it; nothing happens the second time, nor in a fork of the holder."""
        if self._descriptor < 0 or self._process != os.getpid():
            return
        self._beside.unlink(missing_ok=True)  # before the lock is gone: see `_tried`
        os.close(self._descriptor)
        self._descriptor = -1

    def __del__(self) -> None:
        self.release()

    def _tried(self) -> int:
        """The descriptor of the locked file; -1 if who had it took it away meanwhile. BlockingIOError if it is held."""
        descriptor = os.open(self._beside, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.path.samestat(os.fstat(descriptor), os.stat(self._beside)):
                return descriptor
        except FileNotFoundError:
            pass
        except OSError:
            os.close(descriptor)
            raise
        os.close(descriptor)
        return -1

    def _holder(self) -> str:
        """The number of the process that has it, as far as can be told."""
        try:
            return self._beside.read_text(encoding="ascii").strip() or "?"
        except (OSError, ValueError):
            return "?"
