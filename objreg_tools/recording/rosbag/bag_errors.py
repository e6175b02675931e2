# SPDX-License-Identifier: Apache-2.0
"""The error message of a bag that cannot be read, with the remedy that fits its file."""

from __future__ import annotations

import errno
import struct
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from rosbags.highlevel import AnyReaderError
from rosbags.rosbag1 import ReaderError as Rosbag1Error
from rosbags.rosbag2 import ReaderError as Rosbag2Error
from rosbags.serde import SerdeError

from objreg_tools.recording.rosbag.unpacking import UnpackingError

# What the library lets through when the bytes of a file are not what they should be.
BROKEN = (
    AnyReaderError,
    Rosbag1Error,
    Rosbag2Error,
    SerdeError,
    struct.error,
    AssertionError,
    EOFError,
    KeyError,
    IndexError,
    TypeError,
    ValueError,
    AttributeError,
    RuntimeError,  # lz4, and nested too deeply
    MemoryError,  # sizes that lie
    OverflowError,
)
# The packages whose own errors say the same, by name: which of them `rosbags` reads with hangs on its version.
DECODERS = {"apsw", "sqlite3", "backports", "compression", "zstandard"}
REPAIR = {
    ".bag": "`rosbag reindex` repairs a bag that was not closed",
    ".mcap": "`mcap recover` saves what is readable",
    ".db3": "`sqlite3 old.db3 .recover | sqlite3 new.db3` saves what is readable; put it in place of old.db3",
}
BEGINS = {".bag": b"#ROSBAG", ".mcap": b"\x89MCAP0\r\n", ".db3": b"SQLite format 3\0"}
KINDS = {".bag": "a rosbag1", ".mcap": "an mcap", ".db3": "an sqlite3"}
FOOTER, HEADER = 0x02, 0x01  # records of mcap
UNINDEXED = "move metadata.yaml away: the files are read without it"
CHECK = "check the copy, or record it again"


@contextmanager
def broken_means_value_error(path: Path, opened: bool = False) -> Iterator[None]:
    """Turn an error of a library on the bytes of a bag into a ValueError that says expected, got and a remedy.

    What fails once it is ``opened`` is damaged within, even where its records follow each other.
    """
    try:
        yield
    except Exception as error:
        if not says_broken(error):
            raise
        if (denied := _denial(error)) is not None:
            raise PermissionError(f"{path}: expected permission to read it, got: {denied.strerror}") from error
        if isinstance(error, UnpackingError):
            raise ValueError(f"{path}: {error}") from error
        raise broken_bag(path, said(error), opened) from error


def broken_bag(path: Path, got: str, opened: bool = False) -> ValueError:
    """The refusal of a bag file, or of a folder of them, that is not whole."""
    return ValueError(f"{path}: expected a whole bag, got: {got}; {advice(path, opened)}")


def odd_message(path: Path, got: str) -> ValueError:
    """The refusal of a message that is not of its type, though its file is whole."""
    todo = "the file is whole, so it was recorded so; leave the topic out, or record it again"
    return ValueError(f"{path}: expected messages as their type defines them, got: {got}; {todo}")


def said(error: Exception) -> str:
    """An error in one line; with its name where it is none of those that were made to be read."""
    text, name = " ".join(str(error).split()).rstrip("."), type(error).__name__
    if not text or isinstance(error, (LookupError, MemoryError, OverflowError, RecursionError, AttributeError)):
        return f"{name}: {text}".rstrip(": ")
    return text


def says_broken(error: Exception) -> bool:
    """Whether an error comes of the bytes of a file, and not of a bug or of the system."""
    of_bz2 = type(error) is OSError and error.errno is None  # those of the system have a number
    beyond = isinstance(error, OSError) and error.errno == errno.EINVAL  # a place that no file has
    return isinstance(error, BROKEN) or of_bz2 or beyond or type(error).__module__.partition(".")[0] in DECODERS


def advice(path: Path, opened: bool = False) -> str:
    """The remedy for a bag file, or a folder of them, that cannot be read, by its content."""
    if path.is_dir():
        return _advice_of_folder(path, opened)
    begins = _first_bytes(path)
    if begins and path.suffix in BEGINS and not begins.startswith(BEGINS[path.suffix]):
        return f"it is not {KINDS[path.suffix]} file, whatever its name says; {CHECK}"
    if not opened and is_whole_mcap(path):
        return f"the file is whole, but not one that a recorder of ROS 2 wrote{_profile(path)}; convert it to ROS 2"
    return f"truncated or corrupt? {REPAIR.get(path.suffix, CHECK)}"


def _advice_of_folder(folder: Path, opened: bool) -> str:
    files = sorted(file for file in folder.iterdir() if file.suffix in REPAIR and file.is_file())
    odd = [file for file in files if opened or not is_whole_mcap(file)]
    if odd:
        return advice(odd[0], opened)
    return UNINDEXED if files else "put its files back beside metadata.yaml"


def is_whole_mcap(path: Path) -> bool:
    """Whether the records of an mcap file follow each other from its beginning to its end; nothing is unpacked."""
    if path.suffix != ".mcap" or not path.is_file():
        return False
    with suppress(OSError), path.open("rb") as file:
        size, magic = path.stat().st_size, BEGINS[".mcap"]
        if file.read(len(magic)) != magic:
            return False
        last = None
        while file.tell() < size - len(magic) and (last := _skip_record(file, size - len(magic))) is not None:
            pass
        return last == FOOTER and file.read() == magic
    return False


def _skip_record(file: BinaryIO, end: int) -> int | None:
    """The kind of the record of mcap that is passed over; None for one that does not end before ``end``."""
    head = file.read(9)
    if len(head) < 9:
        return None
    length = int.from_bytes(head[1:], "little")
    if length > end - file.tell():
        return None
    file.seek(length, 1)
    return head[0]


def _profile(path: Path) -> str:
    """The writer of an mcap file as text, by its profile; empty where that is ROS 2."""
    head = _first_bytes(path)[8:]
    length = int.from_bytes(head[9:13], "little") if head[:1] == bytes([HEADER]) else 0
    profile = head[13 : 13 + length].decode(errors="replace")
    return "" if profile == "ros2" else f" (its profile is {profile!r})"


def _first_bytes(path: Path) -> bytes:
    with suppress(OSError), path.open("rb") as file:
        return file.read(256)
    return b""


def _denial(error: BaseException | None) -> PermissionError | None:
    """The refusal of the system that an error came of, if one did."""
    while error is not None and not isinstance(error, PermissionError):
        error = error.__cause__ or error.__context__
    return error
