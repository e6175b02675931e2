# SPDX-License-Identifier: Apache-2.0
"""The numbers that stand for class names between the nodes, also for names that no table announced."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterable, Mapping

from objreg_ros import limits
from objreg_ros.data.frames import UNNAMED

MOST_MET = 4096  # names that are met: a detector with more has put something else into its names


class LabelTable:
    """Keeps the numbers of the names that a table announced, and gives a number to every other name.

    ``names`` is the whole table, number → name. It is replaced, never changed, so a holder of one keeps it. It serves
    two threads: one receives the tables, the other meets names.
    """

    def __init__(self) -> None:
        self.names: Mapping[int, str] = {}
        self._lock = threading.Lock()
        self._met: list[str] = []

    def adopt_table(self, stated: Mapping[int, str]) -> None:
        """Adopt a received table; names that were met and that it lacks get new numbers."""
        with self._lock:
            self.names = self._with(dict(stated), self._met)

    def include(self, labels: Iterable[str]) -> bool:
        """Give a number to each name that has none; whether there was such a one.

        ValueError for too many names, and for names that are too long together.
        """
        with self._lock:
            new = sorted(set(labels) - set(self.names.values()) - {UNNAMED})
            if len(self._met) + len(new) > MOST_MET:
                raise ValueError(
                    f"labels: expected at most {MOST_MET} names of classes, got {new[0][:40]!r} beside these"
                )
            self.names = self._with(self.names, new)
            self._met += new
            return bool(new)

    @staticmethod
    def _with(names: Mapping[int, str], more: Iterable[str]) -> Mapping[int, str]:
        """Numbers behind those that are used; ValueError beyond those of class ids, or for more text than is read."""
        known, first = set(names.values()), max(names, default=-1) + 1
        added = dict(enumerate((name for name in more if name not in known), start=first))
        if max(added, default=0) > limits.MOST_CLASS_ID:
            raise ValueError(f"labels: expected numbers of at most {limits.MOST_CLASS_ID}, got {max(added)}")
        table = {**names, **added}
        length = len(json.dumps(table)) if added else 0
        if length > limits.MOST_LABELS_TEXT:
            raise ValueError(f"labels: expected names of at most {limits.MOST_LABELS_TEXT} characters, got {length}")
        return table
