# SPDX-License-Identifier: Apache-2.0
"""The numbers that names of classes go by between the rooms, also of names that nobody told beforehand."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from objreg_ros.data import UNNAMED

MOST_MET = 4096  # names that are met: a detector with more has put something else into its names


class LabelTable:
    """Keeps the numbers of the names that were told, and gives a number to every other name that is met.

    ``names`` is the whole table, number → name. It is replaced, never changed, so whoever holds one keeps it.
    """

    def __init__(self) -> None:
        self.names: Mapping[int, str] = {}
        self._met: list[str] = []

    def adopt(self, told: Mapping[int, str]) -> None:
        """Take a table that was told; names that were met and that it lacks get new numbers."""
        self.names = dict(told)
        self._number(self._met)

    def include(self, labels: Iterable[str]) -> bool:
        """Give a number to each name that has none; whether there was such a one. ValueError for too many names."""
        new = sorted(set(labels) - set(self.names.values()) - {UNNAMED})
        if len(self._met) + len(new) > MOST_MET:
            raise ValueError(f"labels: expected at most {MOST_MET} names of classes, got {new[0][:40]!r} beside these")
        self._met += new
        self._number(new)
        return bool(new)

    def _number(self, labels: Iterable[str]) -> None:
        known = set(self.names.values())
        first = max(self.names, default=-1) + 1
        self.names = {**self.names, **dict(enumerate((name for name in labels if name not in known), start=first))}
