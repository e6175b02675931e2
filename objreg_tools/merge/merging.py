# SPDX-License-Identifier: Apache-2.0
"""The merge itself: the keyframes and closures of all stores into one, then the closures between them.

No more keyframes are in memory than a registrar holds. What is interrupted goes on where it was, see `unfinished`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from objreg_ros.data.closure_id import identity_of
from objreg_ros.data.closures import LoopClosure
from objreg_ros.memory.store import Store, StoreError
from objreg_ros.memory.veto import Veto
from objreg_ros.registrar.params import RegistrarParams
from objreg_tools.merge.sources import Source, Sources, open_sources
from objreg_tools.merge.ties import Leg, Tying, legs_of
from objreg_tools.merge.unfinished import Unfinished

Report = Callable[[int, int], None]  # how many keyframes are done, and of how many


@dataclass(frozen=True)
class Merged:
    """What a merge came to: ``stores`` are what became of each, ``counts`` those of the search between them."""

    path: Path
    stores: tuple[dict[str, Any], ...]
    counts: dict[str, int]
    damaged: tuple[str, ...]


def merge(paths: Sequence[Path], place: Path, params: RegistrarParams, report: Report = lambda *_: None) -> Merged:
    """Merge the stores at ``paths`` into a new one at ``place``, which is there once it is complete.

    ``params`` are the registrar's: how keyframes of two stores are searched for and judged. ``report`` is called after
    every keyframe that was copied and every one that was searched for. StoreError and ValueError as `open_sources` and
    `Unfinished` say, and a StoreError where the disk is full: what was written stays, and the next call goes on.
    """
    with open_sources(paths) as sources:
        unfinished = Unfinished(
            place, [source.identity for source in sources], asdict(params.replaced(threads=1, store=""))
        )
        store = Store(unfinished.store_path)
        try:
            merging = _Merging(store, sources, unfinished, report)
            merging.copy()
            merging.tie(params)
            unfinished.finish(store)
        finally:
            store.close()
        return Merged(place, tuple(map(_about, sources)), unfinished.progress.counts, tuple(merging.damaged))


class _Merging:
    """A merge that goes on from wherever it was."""

    def __init__(self, store: Store, sources: Sources, unfinished: Unfinished, report: Report) -> None:
        self._store, self._sources, self._unfinished, self._report = store, sources, unfinished, report
        self._progress = unfinished.progress
        self._progress.settle(store.next_closure())
        self._done, self._total = 0, sum(map(len, sources)) + sum(map(len, sources[1:]))
        self.damaged = list[str]()

    def copy(self) -> None:
        """Copy the keyframes that are not copied yet, then all closures, which are the first leg, and all vetoes."""
        copied = set(self._store.keyframe_ids())
        for source in self._sources:
            for number, merged in source.numbers():
                if merged not in copied:
                    self._copy_keyframe(source, number, merged)
                self._count(1)
        if not self._progress.legs:
            closures = sum(source.store.counts()["closures"] for source in self._sources)
            kept = (closure for source in self._sources for closure in self._sources.closures(source))
            self._write({"kept": closures}, closures, lambda: self._store.add_closures((one, {}) for one in kept))
        if not self._store.vetoes():
            self._store.veto(self._vetoes())

    def _vetoes(self) -> list[Veto]:
        """What was withdrawn in any store, once, and what others hold of the same two keyframes, whichever came first.

        Where two robots exchange keyframes, the registrars of both may have closed and stored a pair.
        """
        withdrawn = {identity_of(veto.closure): veto for of in map(self._sources.vetoes, self._sources) for veto in of}
        pairs = {_ends(veto.closure) for veto in withdrawn.values()}
        for one in self._store.closures() if pairs else ():
            if _ends(one) in pairs:
                ends = (one.from_session, one.from_ns), (one.to_session, one.to_ns)
                stands = self._store.stand_at(*ends[0]), self._store.stand_at(*ends[1])
                withdrawn.setdefault(identity_of(one), Veto(closure=one, stands=stands))
        return list(withdrawn.values())

    def _copy_keyframe(self, source: Source, number: int, merged: int) -> None:
        try:
            keyframe, sightings = source.read(number, merged)
        except StoreError as error:
            self.damaged.append(str(error))
            return
        self._store.write_keyframe(keyframe, sightings)

    def tie(self, params: RegistrarParams) -> None:
        """Search for the keyframes of each leg that is not written yet."""
        legs = legs_of(self._store, [list(source.sessions.values()) for source in self._sources])
        written = self._progress.legs - 1
        self._count(sum(len(leg.keyframe_ids) for leg in legs[:written]))
        with closing(Tying(self._store, params)) as tying:
            for leg in legs[written:]:
                self._tie_leg(leg, tying)

    def _tie_leg(self, leg: Leg, tying: Tying) -> None:
        counts = Counter[str]()
        for found in tying.search(leg):
            counts += found
            self._count(found["searched"])
        self._write(counts, tying.found(), tying.write)

    def _write(self, counts: Mapping[str, int], closures: int, write: Callable[[], object]) -> None:
        """Write a leg down that comes to so many closures."""
        self._unfinished.begin_leg(counts, self._store.next_closure() + closures)
        write()
        self._unfinished.end_leg()

    def _count(self, keyframes: int) -> None:
        self._done += keyframes
        self._report(self._done, self._total)


def _ends(closure: LoopClosure) -> frozenset[tuple[int | None, int]]:
    """The sessions and stamps of both keyframes."""
    return frozenset({(closure.from_session, closure.from_ns), (closure.to_session, closure.to_ns)})


def _about(source: Source) -> dict[str, Any]:
    """What a store had, and under which numbers and names that is in the merged one."""
    return {
        "path": str(source.path),
        "counts": source.store.counts(),
        "sessions": {str(there): here for there, here in source.sessions.items()},
        "robots": source.names,
        "landmarks_from": source.first.landmark + 1,
        "keyframes_from": source.first.keyframe + 1,
    }
