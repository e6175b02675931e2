# SPDX-License-Identifier: Apache-2.0
"""One registrar for a store: two would give the same ids to different objects.

Our own few lines, as rosdep has no key for the library that has them, `filelock`.
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

MAGIC = b"SQLite format 3\0"
HELPERS = ("-wal", "-shm", "-journal")  # files of SQLite's beside the one that they belong to
HELD: dict[tuple[int, int], tuple[int, int]] = {}  # process and descriptor of what is claimed, by device and inode


class StoreError(OSError):
    """A file that is no store, is damaged or newer (it has not been touched), or that cannot be written."""


class Claim:
    """The file at ``path``, kept to one holder until `release`, or until its process ends, however it ends.

    What is locked is the file itself, by whatever name it is called, with `flock`. SQLite's own locks (`fcntl`) know
    nothing of that, so readers still come in. ``make`` writes the file, where there is none, under the name that it
    is given. StoreError if another one has it.
    """

    def __init__(self, path: Path, make: Callable[[Path], None]) -> None:
        self._path, self._real = path, path.resolve()  # of a link what it leads to
        self._process, self._descriptor = os.getpid(), -1
        try:
            while self._descriptor < 0:
                if not self._real.exists():
                    self._put(make, new=True)
                else:
                    self._descriptor = _locked(self._real, os.O_RDWR)
        except BlockingIOError as error:
            raise StoreError(
                f"{path}: in use by another registrar: expected a store that nobody else writes, got one of process "
                f"{error.args[0]}; end that, or use another path"
            ) from None
        except StoreError:
            raise
        except OSError as error:
            raise StoreError(f"{path}: cannot keep it from other registrars: {error}") from error

    def replace(self, make: Callable[[Path], None]) -> None:
        """Put what ``make`` writes in the place of the file, whole or not at all, and keep the claim upon that."""
        try:
            self._put(make, new=False)
        except BlockingIOError as error:
            raise StoreError(f"{self._path}: in use by another registrar, process {error.args[0]}") from None

    def release(self) -> None:
        """Let others have it; nothing happens the second time, nor in a fork of the holder.

        It must come after the end of every connection to the file: with any descriptor of a file that a process
        closes, SQLite's locks upon it are gone.
        """
        if self._descriptor < 0 or self._process != os.getpid():
            return
        _let_go(self._descriptor)
        self._descriptor = -1

    def __del__(self) -> None:
        self.release()

    def _put(self, make: Callable[[Path], None], new: bool) -> None:
        """Write a file beside the place, under a lock from its first byte, and move it there."""
        beside = self._real.with_name(f"{self._real.name}.new")
        descriptor = _locked(beside, os.O_RDWR | os.O_CREAT)
        if descriptor < 0:
            return
        if os.pread(descriptor, len(MAGIC), 0) not in (b"", MAGIC):
            _let_go(descriptor)
            raise StoreError(f"{beside}: expected no file, got one of another kind; move it, or use another store")
        done = False
        try:
            if new and self._real.exists():  # another one was faster
                return
            os.ftruncate(descriptor, 0)  # what a killed process left
            _remove_helpers(beside)
            make(beside)
            _remove_helpers(self._real)  # of a file that was there before: they would be taken for the new one's
            os.replace(beside, self._real)
            done = True
            _keep_name(self._real.parent)
        finally:
            if not done:
                _remove_helpers(beside)
                beside.unlink(missing_ok=True)
                _let_go(descriptor)
        old, self._descriptor = self._descriptor, descriptor
        if old >= 0:
            _let_go(old)


@contextmanager
def unwritten_by_others(path: Path) -> Iterator[None]:
    """Keeps registrars from the file at ``path`` within the block, which only reads it. StoreError if one has it.

    Every connection to the file must end before the block does, as with `Claim.release`.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except OSError as error:
        raise StoreError(f"{path}: expected a store that can be read, got: {error.strerror}") from error
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
        yield
    except BlockingIOError:
        raise StoreError(
            f"{path}: in use by a registrar: expected a store that nobody writes, got one of process "
            f"{_holder(_inode(os.fstat(descriptor)))}; end that"
        ) from None
    finally:
        os.close(descriptor)


def read_header(path: Path) -> bytes:
    """The first 100 bytes of a file, read so that no lock upon it is lost where this process has it open."""
    held = HELD.get(_inode(os.stat(path)))
    if held is not None and held[0] == os.getpid():
        return os.pread(held[1], 100, 0)
    with path.open("rb") as file:
        return file.read(100)


def _locked(path: Path, how: int) -> int:
    """The descriptor of a locked file; -1 if another is there now. BlockingIOError with its holder if it is held."""
    with suppress(FileNotFoundError):
        held = HELD.get(_inode(os.stat(path)))
        if held is not None and held[0] == os.getpid():  # not opened: to close it would end SQLite's locks
            raise BlockingIOError(held[0])
    try:
        descriptor = os.open(path, how | os.O_CLOEXEC, 0o644)
    except FileNotFoundError:
        return -1
    inode = _inode(os.fstat(descriptor))
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if inode == _inode(os.stat(path)):
            HELD[inode] = os.getpid(), descriptor
            return descriptor
    except BlockingIOError:
        os.close(descriptor)
        raise BlockingIOError(_holder(inode)) from None
    except FileNotFoundError:
        pass
    except OSError:
        os.close(descriptor)
        raise
    os.close(descriptor)
    return -1


def _let_go(descriptor: int) -> None:
    HELD.pop(_inode(os.fstat(descriptor)), None)
    os.close(descriptor)


def _inode(status: os.stat_result) -> tuple[int, int]:
    return status.st_dev, status.st_ino


def _holder(inode: tuple[int, int]) -> str:
    """The number of the process that has a file, as far as the kernel reports it."""
    with suppress(OSError, ValueError, IndexError):
        for line in Path("/proc/locks").read_text(encoding="ascii").splitlines():
            parts = line.split()
            if "FLOCK" in parts and parts[-3].endswith(f":{inode[1]}"):
                return parts[-4]
    return "?"


def _remove_helpers(path: Path) -> None:
    for helper in HELPERS:
        path.with_name(path.name + helper).unlink(missing_ok=True)


def _keep_name(folder: Path) -> None:
    """Bring the name of a file onto the disk."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
