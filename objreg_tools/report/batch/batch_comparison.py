# SPDX-License-Identifier: Apache-2.0
"""A batch against another of before: which recordings changed, and what each of them gained and lost.

Recordings are the same by their path; where that moved, by a name that only one of each batch has.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from objreg_tools.report.batch.batch_rows import Row
from objreg_tools.report.run.comparison import matched

RESULT = re.compile(r"(?P<name>.*)-[0-9a-f]{8}\.json")
COUNTS = ("frames", "detections", "objects", "constraints", "strict", "loose", "false")


class Ends(NamedTuple):
    """The stamps of a constraint."""

    from_ns: int
    to_ns: int


@dataclass(frozen=True, slots=True)
class Change:
    """One recording in both batches. ``before`` is None where the other has none, and then there are no counts."""

    row: Row
    before: Row | None
    kept: int = 0
    gained: int = 0
    lost: int = 0
    settings: Mapping[str, tuple[Any, Any]] | None = None  # what it was made with, before and now, where they differ
    error: str = ""  # why what the other batch has cannot be compared

    @property
    def is_changed(self) -> bool:
        """Whether a count, a constraint or a failure differs; False without anything to compare with."""
        if self.before is None:
            return False
        counts = any(getattr(self.row, name) != getattr(self.before, name) for name in COUNTS)
        return bool(self.gained or self.lost or counts or self.row.error)

    @property
    def weight(self) -> tuple[int, int, int]:
        """What comes first on the page is lower: changed rows, of these those with other false constraints."""
        false = abs((self.row.false or 0) - ((self.before.false if self.before else 0) or 0))
        return (0 if self.is_changed else 1 if self.before is None else 2, -false, -(self.gained + self.lost))


def other_result(folder: Path, file: str, recordings: Sequence[Path]) -> Path | None:
    """The JSON in another batch's folder of the recording whose JSON is called ``file`` here; None where there is none.

    ``recordings`` are those of this batch: a name that two of them have says nothing.
    """
    if (folder / file).is_file():
        return folder / file
    found = RESULT.fullmatch(file)
    name = found["name"] if found else ""
    namesakes = [one for one in folder.glob("*.json") if (m := RESULT.fullmatch(one.name)) and m["name"] == name]
    is_one = sum(recording.name == name for recording in recordings) == 1 and len(namesakes) == 1
    return namesakes[0] if is_one else None


def change(row: Row, now: Mapping[str, Any] | None, before: Mapping[str, Any] | None, error: str = "") -> Change:
    """What became of a recording, by the JSON of both; None where one failed or is not there."""
    if before is None:
        return Change(row, None, error=error)
    row_before = Row.of(Path(before["recording"]), "", before)
    if now is None:
        return Change(row, row_before, lost=row_before.constraints)
    both = [[Ends(one["from_ns"], one["to_ns"]) for one in summary["constraints"]] for summary in (before, now)]
    kept = len(matched(*both))
    settings = _differing(before["batch"]["made"], now["batch"]["made"])
    return Change(row, row_before, kept, len(both[1]) - kept, len(both[0]) - kept, settings)


def ordered(changes: Iterable[Change]) -> list[Change]:
    """Changed rows first, those whose false constraints changed before all others."""
    return sorted(changes, key=lambda one: (one.weight, one.row.name))


def settings_of(changes: Iterable[Change]) -> dict[str, set[tuple[str, str]]]:
    """By name what the two batches were made with, before and now, where they differ anywhere."""
    found: dict[str, set[tuple[str, str]]] = {}
    for one in changes:
        for name, (before, now) in (one.settings or {}).items():
            found.setdefault(name, set()).add((str(before), str(now)))
    return dict(sorted(found.items()))


def _differing(before: Mapping[str, Any], now: Mapping[str, Any]) -> dict[str, tuple[Any, Any]]:
    names = sorted(before.keys() | now.keys())
    return {
        name: (before.get(name, "default"), now.get(name, "default"))
        for name in names
        if before.get(name) != now.get(name) and name != "recording"
    }
