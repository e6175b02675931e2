# SPDX-License-Identifier: Apache-2.0
"""A merge that is not finished: where its store lies meanwhile, and how far it came.

The store lies beside its place until it is complete, so what has the name of the merged store is complete. Keyframes
are counted by the store itself. Closures are written leg by leg; the file of the progress says before each which
numbers they will have, so that after a kill it is known whether they were written.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from objreg_ros.memory.store import Store
from objreg_ros.memory.store_file import is_store
from objreg_ros.whole_file import write_whole

FORMAT = "objreg-merge/1"


@dataclass
class Progress:
    """How many legs are written, what they came to, and what the one that is being written has.

    ``next_closure`` is the number of the first closure after that leg.
    """

    legs: int = 0
    counts: dict[str, int] = field(default_factory=dict)
    next_closure: int = 0
    pending: dict[str, int] | None = None

    def settle(self, next_closure: int) -> None:
        """Find out by the store's next number whether the leg that was being written is."""
        if self.pending is not None and next_closure == self.next_closure:
            self.counts = added(self.counts, self.pending)
            self.legs += 1
        self.pending = None


class Unfinished:
    """The unfinished merge of ``inputs`` into ``place``, by ``params``; one that was begun before goes on.

    ValueError where something is at ``place``, or another merge into it was begun.
    """

    def __init__(self, place: Path, inputs: Sequence[Mapping[str, Any]], params: Mapping[str, Any]) -> None:
        if os.path.lexists(place):
            raise ValueError(f"{place}: expected a new file, got one that exists; move it, or choose another")
        self.place = place
        self.store_path = unfinished_path(place)
        self._file = place.with_name(f"{place.name}.unfinished.json")
        asked = {"format": FORMAT, "inputs": [dict(one) for one in inputs], "params": dict(params)}
        self._of = json.loads(json.dumps(asked))  # as it is read again
        self.goes_on = self.store_path.exists()
        self.progress = self._read() if self.goes_on else Progress()
        if not self.goes_on:
            self._write()

    def begin_leg(self, counts: Mapping[str, int], next_closure: int) -> None:
        """A leg is going to be written; it came to ``counts``, and the closure after it would be ``next_closure``."""
        self.progress.pending, self.progress.next_closure = dict(counts), next_closure
        self._write()

    def end_leg(self) -> None:
        """The leg is written."""
        self.progress.settle(self.progress.next_closure)

    def finish(self, store: Store) -> None:
        """Give the whole store its name, and close it."""
        store.save()
        store.close()
        os.replace(self.store_path, self.place)
        self._file.unlink(missing_ok=True)

    def _write(self) -> None:
        write_whole(self._file, json.dumps(self._of | {"progress": asdict(self.progress)}, indent=1))

    def _read(self) -> Progress:
        advice = f"delete {self.store_path} and begin anew, or choose another place"
        try:
            known = json.loads(self._file.read_text(encoding="utf-8"))
            of, progress = {name: known[name] for name in self._of}, Progress(**known["progress"])
        except (OSError, ValueError, LookupError, TypeError) as error:
            raise ValueError(f"{self._file}: expected how far the merge came, got none ({error}); {advice}") from error
        if not is_store(self.store_path):
            raise ValueError(f"{self.store_path}: expected an unfinished merge, got another file; {advice}")
        for name, given in self._of.items():
            if of[name] != given:
                raise ValueError(
                    f"{self.store_path}: expected the unfinished merge of the same {name}, got one of others: "
                    f"{_shown(of[name])}; {advice}"
                )
        return progress


def unfinished_path(place: Path) -> Path:
    """Where the store of a merge into ``place`` lies until it is complete."""
    return place.with_name(f"{place.name}.unfinished")


def added(counts: Mapping[str, int], more: Mapping[str, int]) -> dict[str, int]:
    """The sums by name."""
    return {name: counts.get(name, 0) + more.get(name, 0) for name in [*counts, *(n for n in more if n not in counts)]}


def _shown(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(str(one["path"]) for one in value)
    return str(value)
