# SPDX-License-Identifier: Apache-2.0
"""Writes records as a rosbag2 folder."""

from __future__ import annotations

import errno
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

from rosbags.interfaces import Qos
from rosbags.rosbag2 import StoragePlugin, Writer

from objreg_ros.whole_file import unwritten
from objreg_tools.recording.record import Record
from objreg_tools.recording.rosbag.messages import standard_types

STORAGES = {"mcap": StoragePlugin.MCAP, "sqlite3": StoragePlugin.SQLITE3}
METADATA_VERSION: Literal[9] = 9  # Jazzy's
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EROFS)  # errors of a disk, never of a reader of a recording


def write_rosbag2(
    path: Path | str,
    records: Iterable[Record],
    storage: str = "mcap",
    offered_qos: Mapping[str, Sequence[Qos]] = MappingProxyType({}),
) -> int:
    """Write records in order to a new folder; their number comes back. ``offered_qos`` is as `Recording.offered_qos`.

    ValueError for a storage that there is not or a type that ROS 2 does not ship, FileExistsError for a folder that is
    already there, OSError for one that cannot be made. What fails leaves no folder.
    """
    if storage not in STORAGES:
        raise ValueError(f"storage: expected one of {', '.join(STORAGES)}, got {storage!r}")
    if Path(path).exists():
        raise FileExistsError(f"{path}: expected a new folder, got one that exists; choose another name or remove it")
    _make_parents(Path(path))
    count = 0
    with (
        whole_or_gone(Path(path)),
        Writer(Path(path), version=METADATA_VERSION, storage_plugin=STORAGES[storage]) as writer,
    ):
        connections: dict[tuple[str, str], Any] = {}
        for record in records:
            key = (record.topic, record.msgtype)
            if key not in connections:
                connections[key] = _connect(writer, record, offered_qos.get(record.topic, ()))
            writer.write(connections[key], record.stamp_ns, record.cdr)
            count += 1
    return count


@contextmanager
def whole_or_gone(path: Path) -> Iterator[None]:
    """Removes the folder where it could not be finished. OSError that names it where the disk is why."""
    try:
        yield
    except BaseException as error:
        shutil.rmtree(path, ignore_errors=True)
        if isinstance(error, OSError) and error.errno in FULL:
            raise unwritten(path, error) from error
        raise


def _make_parents(path: Path) -> None:
    try:
        path.absolute().parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OSError(f"{path}: expected a path that can be written, got: {error.strerror}") from error


def _connect(writer: Writer, record: Record, offered: Sequence[Qos]) -> Any:
    if record.msgtype not in standard_types().types:
        raise ValueError(f"{record.topic}: expected a type that ROS 2 ships, got {record.msgtype}")
    types = standard_types()
    return writer.add_connection(record.topic, record.msgtype, typestore=types, offered_qos_profiles=offered)
