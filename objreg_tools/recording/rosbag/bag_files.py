# SPDX-License-Identifier: Apache-2.0
"""The files of a folder that are one recording, and a reader over them: with metadata.yaml, or without.

A crash, a full disk or a hand leave bags whose metadata.yaml is missing, empty or names files that are gone. The files
themselves say all that is needed, so they are read, and what was done is said.
"""

from __future__ import annotations

import re
import shutil
import sqlite3
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path

import yaml
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import reader as rosbag2

from objreg_tools.recording.folders.text import SETTINGS_BYTES, require_regular
from objreg_tools.recording.rosbag.bag_errors import advice, broken_means_value_error, said, says_broken
from objreg_tools.recording.rosbag.messages import standard_types
from objreg_tools.recording.rosbag.unpacking import UnpackingError, require_disk, require_space, zstd_bound

METADATA = "metadata.yaml"
METADATA_BYTES = 16 * SETTINGS_BYTES  # it has a line for every file and every topic
BAG_FILES = (".bag", ".mcap", ".db3")
PACKED = (".mcap.zstd", ".db3.zstd")
COPIES = 0.5  # of the time of the shorter of two files; parts of one recording hardly overlap


@dataclass
class OpenBag:
    """A reader that is open, the files that it reads, and what the user should know of the choice."""

    reader: AnyReader
    files: list[Path]
    notes: list[str] = field(default_factory=list)
    kept: ExitStack = field(default_factory=ExitStack)
    """The resources to release when the bag is closed: files that were unpacked."""


def is_bag(file: Path) -> bool:
    """Whether a file is one of a recording by its name."""
    return file.suffix in BAG_FILES or file.name.endswith(PACKED)


def bag_files(folder: Path) -> list[Path]:
    """The bag files in a folder, in the order of their numbers where they have such; of a packed twin the plain one."""
    files = [file for file in folder.iterdir() if is_bag(file) and not file.name.startswith(".") and not file.is_dir()]
    names = {file.name for file in files}
    return sorted((file for file in files if file.name.removesuffix(".zstd") not in names - {file.name}), key=_place)


def open_bag(path: Path) -> OpenBag:
    """The bag at ``path``, a file or a folder. ValueError for one that is broken, with what to do."""
    _require_readable(path)
    if not path.is_dir():
        return _open_files([path])
    files = bag_files(path)
    if not (path / METADATA).exists() or any(map(_unmerged, files)):
        return _with_notes(_open_files(files), path)
    try:
        with broken_means_value_error(path):
            require_space(path)
            return _with_notes(OpenBag(_opened([path]), _named(path, files)), path)
    except ValueError as error:
        if not files or isinstance(error.__cause__, UnpackingError | RecursionError):
            raise
        return _without_metadata(path, files, error)


def _without_metadata(folder: Path, files: Sequence[Path], error: ValueError) -> OpenBag:
    """The files of a folder whose metadata.yaml failed; ``error`` again where they fail too."""
    try:
        bag = _open_files(files)
    except ValueError as of_files:
        if len(files) > 1 or isinstance(of_files.__cause__, UnpackingError):
            raise of_files from error
        raise error from error.__cause__  # not from itself: a chain without end cannot be sent to another process
    if bag.files == list(files):
        cause = error.__cause__ if isinstance(error.__cause__, Exception) else error
        bag.notes.insert(0, f"{METADATA} is not used ({_why(folder, cause)}): {_listed(bag.files)} read without it")
    return _with_notes(bag, folder)


def _why(folder: Path, error: Exception) -> str:
    if not (folder / METADATA).read_bytes().strip(b" \t\r\n\0"):
        return "it is empty"
    gone = [name for name in named_files(folder) if not (folder / name).exists()]
    return f"it names {_listed(gone)}, which is not there" if gone else said(error)[:200]


def named_files(folder: Path) -> list[str]:
    """The names of the files of which metadata.yaml says that they are the bag; none where it does not say."""
    try:
        values = yaml.safe_load((folder / METADATA).read_text(encoding="utf-8-sig"))
        return [Path(name).name for name in values["rosbag2_bagfile_information"]["relative_file_paths"]]
    except (OSError, yaml.YAMLError, ValueError, LookupError, TypeError, RecursionError):
        return []


def _named(folder: Path, files: Sequence[Path]) -> list[Path]:
    names = set(named_files(folder))
    return [file for file in files if file.name in names] or list(files)


def _with_notes(bag: OpenBag, folder: Path) -> OpenBag:
    """The bag with a note on what else is in its folder, and on how several files were put together."""
    if len(bag.files) > 1 and not (folder / METADATA).exists():
        bag.notes.insert(0, f"no {METADATA}: {_listed(bag.files)} are read as one recording, in order of time")
    others = sorted(file.name for file in bag_files(folder) if file not in bag.files)
    others = [name for name in others if not any(name in note for note in bag.notes)]
    if others:
        bag.notes.append(f"also there, and not read: {_listed(others)}; name such a file to read it")
    return bag


def _open_files(files: Sequence[Path]) -> OpenBag:
    """The files as one recording; those that are broken are left out with a note, unless all are."""
    _require_one_kind(files)
    kept, notes = ExitStack(), list[str]()
    try:
        ready = {file: _ready(file, kept, notes) for file in files}
        reader, whole = _opened_of(ready, notes)
        bag = OpenBag(reader, whole, notes, kept)
        if len(whole) > 1:
            _require_parts(reader, whole)
        return bag
    except BaseException:
        kept.close()
        raise


def _opened_of(ready: dict[Path, Path], notes: list[str]) -> tuple[AnyReader, list[Path]]:
    """A reader over what can be opened, and which files that is."""
    if len(ready) == 1:
        ((file, place),) = ready.items()
        with broken_means_value_error(file):
            return _opened([place]), [file]
    try:
        return _opened(list(ready.values())), list(ready)
    except Exception as error:
        if not says_broken(error):
            raise
    refusals = {file: why for file, place in ready.items() if (why := _refusal(file, place)) is not None}
    whole = [file for file in ready if file not in refusals]
    if not whole:
        raise next(iter(refusals.values()))
    notes += [f"{file.name} is left out ({why.__cause__}): {advice(file)}" for file, why in refusals.items()]
    with broken_means_value_error(whole[0].parent):
        return _opened([ready[file] for file in whole]), whole


def _opened(paths: list[Path]) -> AnyReader:
    reader = AnyReader(paths, default_typestore=standard_types())
    reader.open()
    return reader


def _refusal(file: Path, place: Path) -> ValueError | None:
    """Why a file cannot be opened; None where it can."""
    try:
        with broken_means_value_error(file):
            _opened([place]).close()
    except ValueError as error:
        return error
    return None


def _require_one_kind(files: Sequence[Path]) -> None:
    """ValueError for a rosbag1 beside a rosbag2: they are hardly one recording, and no reader takes both."""
    kinds = {file.suffix == ".bag" for file in files}
    if len(kinds) > 1:
        raise ValueError(f"{files[0].parent}: expected bag files of one kind, got {_listed(files)}; name one of them")


def _require_parts(reader: AnyReader, files: Sequence[Path]) -> None:
    """ValueError for files that hold the same topics at the same time: copies, and not parts of one recording."""
    spans = [(one.start_time, one.end_time, {c.topic for c in one.connections if c.msgcount}) for one in reader.readers]
    for (a, (a_start, a_end, a_topics)), (b, (b_start, b_end, b_topics)) in combinations(
        zip(files, spans, strict=True), 2
    ):
        common = min(a_end, b_end) - max(a_start, b_start)
        same = bool(a_topics and b_topics) and (a_topics <= b_topics or b_topics <= a_topics)
        if same and common > COPIES * min(a_end - a_start, b_end - b_start):
            reader.close()
            raise ValueError(
                f"{a.parent}: expected bag files that follow each other, got {a.name} and {b.name} with the same "
                "topics at the same time; name one of them, or move the copy away"
            )


def _ready(file: Path, kept: ExitStack, notes: list[str]) -> Path:
    """The file itself, or what it is after it was unpacked or merged into the temporary folder."""
    if file.name.endswith(PACKED):
        with broken_means_value_error(file):
            require_disk(file.stat().st_size, zstd_bound(file))
            place = _temporary(kept) / file.stem
            with file.open("rb") as packed, rosbag2.zstd.open(packed, "rb") as whole, place.open("wb") as out:
                shutil.copyfileobj(whole, out)
        return place
    return _merged(file, kept, notes) if _unmerged(file) else file


def _merged(file: Path, kept: ExitStack, notes: list[str]) -> Path:
    """A copy of a database with what its -wal file holds; the recorder was stopped before it wrote that into it."""
    wal = _wal(file)
    size = file.stat().st_size + wal.stat().st_size
    with broken_means_value_error(file):
        require_disk(size, size)
        place = _temporary(kept) / file.name
        shutil.copyfile(file, place)
        shutil.copyfile(wal, _wal(place))
        connection = sqlite3.connect(place)
        try:
            connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
            connection.execute("PRAGMA journal_mode=DELETE")
        finally:
            connection.close()
    notes.append(f"{wal.name} holds what was not written into {file.name} yet: both are read, merged in a copy")
    return place


def _unmerged(file: Path) -> bool:
    return file.suffix == ".db3" and _wal(file).is_file() and _wal(file).stat().st_size > 0


def _wal(file: Path) -> Path:
    return file.with_name(f"{file.name}-wal")


def _temporary(kept: ExitStack) -> Path:
    return Path(kept.enter_context(tempfile.TemporaryDirectory(prefix="objreg-bag-")))


def _place(file: Path) -> list[str | int]:
    """The order of names by their numbers: rec_2 before rec_10."""
    return [int(part) if k % 2 else part for k, part in enumerate(re.split("([0-9]+)", file.name))]


def _listed(files: Sequence[Path | str]) -> str:
    names = [file if isinstance(file, str) else file.name for file in files]
    return ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")


def _require_readable(path: Path) -> None:
    """ValueError for what the library would wait for, or read, without end."""
    if not path.is_dir():
        require_regular(path)
        return
    for file in sorted(file for file in path.iterdir() if not file.is_dir() and file.exists()):
        size = require_regular(file)
        if file.name == METADATA and size > METADATA_BYTES:
            raise ValueError(f"{file}: expected at most {METADATA_BYTES} bytes of metadata, got {size}; reindex it")
