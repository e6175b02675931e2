# SPDX-License-Identifier: Apache-2.0
"""The files that a map is written to: never over what is not a map of ours."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path

from objreg_mapper.formats.g2o import TIMES, TIMES_END, times_file
from objreg_ros.whole_file import write_whole

VERTEX = re.compile(rb"VERTEX_SE3:QUAT 0( -?\d+\.\d{9}){7}\n")  # as `graph_text` begins
MEMBERS = {"told.npy", "ends.npy"}  # of what `saved.save` writes
MOST_LINE = 500  # bytes of the first line


def graph_file(graph_path: str) -> Path:
    """The absolute place of a graph's text. ValueError where its folder is not there or a file that is not ours is."""
    try:
        path = Path(graph_path).expanduser().absolute()
        if not path.parent.is_dir():
            raise ValueError(f"expected a file in a folder that is there, got {path}")
        for file in (path, times_file(path)):
            require_ours(file)
    except (ValueError, OSError, RuntimeError) as error:  # the latter of a home that there is not
        raise ValueError(f"graph_path: {error}") from error
    return path


def write_graph(path: Path, text: str, times: str) -> None:
    """Write a graph's text and, beside it, the times of its vertices; each is whole or as it was before.

    OSError where one of them cannot be written or is not ours.
    """
    for file in (path, times_file(path)):
        require_ours(file)
    write_whole(times_file(path), times)
    write_whole(path, text)


def require_ours(path: Path) -> None:
    """OSError where what is at ``path`` is no plain file, or one that is neither empty nor written by a map's save."""
    if not path.exists():
        return
    if not path.is_file():
        raise OSError(f"{path}: expected a plain file or none, got a folder, pipe or device; choose another place")
    if path.stat().st_size and not _is_ours(path):
        raise OSError(f"{path}: expected a map or none, got another file, which is kept; choose another place")


def _is_ours(path: Path) -> bool:
    if path.name.endswith(TIMES_END):
        return _is_times(path)
    return _is_saved_map(path) if path.suffix == ".npz" else _is_graph_text(path)


def _is_graph_text(path: Path) -> bool:
    with path.open("rb") as file:
        return VERTEX.fullmatch(file.readline(MOST_LINE)) is not None


def _is_times(path: Path) -> bool:
    with path.open("rb") as file:
        return file.readline(MOST_LINE) == f"{TIMES}\n".encode()


def _is_saved_map(path: Path) -> bool:
    try:
        with zipfile.ZipFile(path) as archive:
            return set(archive.namelist()) >= MEMBERS
    except zipfile.BadZipFile:
        return False
