# SPDX-License-Identifier: Apache-2.0
"""The text files of a TUM RGB-D folder and its kin: rows of columns, their times, and which column is what.

Columns are parted by spaces, tabs, commas or semicolons, as the benchmark's associate.py has them. A comment or a first
line without numbers may name them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from decimal import Decimal
from pathlib import Path
from typing import NamedTuple

from objreg_tools.recording.folders.text import read_text

NS_DIGITS = 19
FRAME_DIGITS = 9  # the number of a frame has fewer than a time since 1970
END_OF_TIME_S = 2**31  # the limit of a message's stamp, in 2038
BETWEEN = re.compile(r"[\s,;]+")
UNIT = re.compile(r"\s*[\[(][^\])]*[\])]")  # EuRoC's " [m]" and " []"
POSITION = re.compile(r"(t|p|pos|position|tran|translation)?_?(\w+_)?([xyz])")
QUATERNION = re.compile(r"(q|quat|quaternion|rot|rotation|orientation)_?(\w+_)?([xyzw])")
USUAL = (1, 2, 3, 4, 5, 6, 7)


class Table(NamedTuple):
    """The rows of a text file, and the names of its columns where a line above them gives these."""

    rows: list[list[str]]
    names: tuple[str, ...]


def read_table(file: Path, columns: int) -> Table:
    """The rows of a file, of so many columns at least; ValueError for a shorter one."""
    rows: list[list[str]] = []
    names: tuple[str, ...] = ()
    for line in map(str.strip, read_text(file).splitlines()):
        if line.startswith("#") or (not rows and line and _names_columns(line)):
            names = names if rows else _names(line) or names
        elif line:
            rows.append([text for text in BETWEEN.split(line) if text])
    short = next((row for row in rows if len(row) < columns), None)
    if short is not None:
        raise ValueError(f"{file}: expected {columns} columns in each line, got {' '.join(short)!r}")
    return Table(rows, names)


def pose_columns(names: Sequence[str]) -> tuple[int, ...]:
    """The columns of x y z and qx qy qz qw, by their names; the usual ones where the names do not give all."""
    places: dict[str, int] = {}
    for k, name in enumerate(names):
        for kind, pattern in (("q", QUATERNION), ("t", POSITION)):
            if (known := pattern.fullmatch(name)) is not None:
                places.setdefault(kind + known.group(3), k)
                break
    wanted = ("tx", "ty", "tz", "qx", "qy", "qz", "qw")
    return tuple(places[name] for name in wanted) if all(name in places for name in wanted) else USUAL


def are_frame_numbers(stamps: Iterable[str]) -> bool:
    """Whether all stamps are the numbers of frames and no times: whole, and too small for seconds since 1970."""
    return all(text.isdecimal() and len(text) <= FRAME_DIGITS for text in stamps)


def stamp_of(text: str, file: Path) -> int:
    """Nanoseconds of a time in seconds, or of 19 digits that are nanoseconds already: those of 2001 and later."""
    is_ns = len(text) == NS_DIGITS and text.isdecimal()
    try:
        seconds = Decimal(text) / (10**9 if is_ns else 1)
        if abs(seconds) < END_OF_TIME_S:
            return int((seconds * 10**9).to_integral_value())
    except ArithmeticError:  # no number, or none that can be compared
        pass
    raise ValueError(f"{file}: expected a time in seconds (or 19 digits of nanoseconds), got {text!r}")


def _names_columns(line: str) -> bool:
    """Whether a line has nothing but names, as the first one of a CSV file."""
    parts = [text for text in BETWEEN.split(UNIT.sub("", line)) if text]
    return len(parts) > 1 and all(re.fullmatch(r"[A-Za-z_]\w*", part) for part in parts)


def _names(line: str) -> tuple[str, ...]:
    """The names of columns in a line that begins with that of the time; none in another comment."""
    parts = [text.lower() for text in BETWEEN.split(UNIT.sub("", line.lstrip("#"))) if text]
    return tuple(parts) if parts and parts[0].startswith(("time", "stamp", "t_", "frame")) else ()
