# SPDX-License-Identifier: Apache-2.0
"""The stores that are merged. They are only read, and what is read comes under the numbers of the merged store."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

from objreg_ros.data.closures import LoopClosure
from objreg_ros.memory.claim import unwritten_by_others
from objreg_ros.memory.sighting import Sighting
from objreg_ros.memory.store import Store
from objreg_ros.memory.veto import Veto
from objreg_ros.registration.keyframe import Keyframe
from objreg_tools.merge.robot_names import renamed_frame, robot_names


class First(NamedTuple):
    """What is added to the numbers of a store: so many are before them in the merged one."""

    keyframe: int = 0
    session: int = 0
    landmark: int = 0


class Moment(NamedTuple):
    """An end of a closure in the merged store."""

    robot: str
    session: int | None
    frame_id: str


@dataclass(frozen=True)
class Source:
    """A store that is read, its place among the others, and what its numbers and names become."""

    path: Path
    store: Store
    first: First
    names: dict[str, str]

    def __len__(self) -> int:
        return len(self.store.keyframe_ids())

    @property
    def sessions(self) -> dict[int, int]:
        """The sessions of which keyframes are stored, and their numbers in the merged store."""
        return {there: there + self.first.session for there in sorted({head["session"] for head in self.store.heads()})}

    @property
    def identity(self) -> dict[str, Any]:
        """By what it is known that it is the same as before."""
        status = self.path.stat()
        return {"path": str(self.path.resolve()), "bytes": status.st_size, "changed_ns": status.st_mtime_ns}

    def numbers(self) -> Iterator[tuple[int, int]]:
        """Each keyframe's id here, and in the merged store."""
        for k, number in enumerate(self.store.keyframe_ids()):
            yield number, self.first.keyframe + k + 1

    def read(self, number: int, merged: int) -> tuple[Keyframe, list[Sighting]]:
        """A keyframe and its objects as those of the merged store, where its id is ``merged``.

        StoreError where it is damaged.
        """
        keyframe = self.store.keyframe(number)
        name = self.names[keyframe.robot]
        renamed = replace(
            keyframe,
            keyframe_id=merged,
            session=keyframe.session + self.first.session,
            robot=name,
            frame_id=renamed_frame(keyframe.frame_id, keyframe.robot, name),
        )
        sightings = [
            replace(
                sighting,
                keyframe_id=merged,
                session=renamed.session,
                robot=name,
                landmark=sighting.landmark + self.first.landmark if sighting.landmark else 0,
            )
            for sighting in self.store.sightings(number)
        ]
        return renamed, sightings


class Sources(list[Source]):
    """The stores in the order in which they are merged."""

    def closures(self, source: Source) -> Iterator[LoopClosure]:
        """The closures of a store as those of the merged one, the oldest first.

        An end that another robot's registrar stores is the keyframe of the store which has it, if one has.
        """
        return (self._renamed(source, closure) for closure in source.store.closures())

    def vetoes(self, source: Source) -> Iterator[Veto]:
        """What a person withdrew of a store, as `closures`."""
        return (replace(veto, closure=self._renamed(source, veto.closure)) for veto in source.store.vetoes())

    def _renamed(self, source: Source, closure: LoopClosure) -> LoopClosure:
        one = self._moment(source, closure.from_robot, closure.from_session, closure.from_frame_id, closure.from_ns)
        other = self._moment(source, closure.to_robot, closure.to_session, closure.to_frame_id, closure.to_ns)
        objects = (
            replace(match, object_id=match.object_id + source.first.landmark) if match.object_id else match
            for match in closure.objects
        )
        return replace(
            closure,
            objects=tuple(objects),
            from_robot=one.robot,
            from_session=one.session,
            from_frame_id=one.frame_id,
            to_robot=other.robot,
            to_session=other.session,
            to_frame_id=other.frame_id,
        )

    def _moment(self, source: Source, robot: str, session: int | None, frame_id: str, stamp_ns: int) -> Moment:
        if robot not in source.names and (found := self._elsewhere(source, robot, stamp_ns)) is not None:
            return Moment(found[0], found[1], renamed_frame(frame_id, robot, found[0]))
        name = source.names.get(robot, robot)
        number = None if session is None else session + source.first.session
        return Moment(name, number, renamed_frame(frame_id, robot, name))

    def _elsewhere(self, source: Source, robot: str, stamp_ns: int) -> tuple[str, int] | None:
        """The robot and session of the keyframe that another store has of a robot's stamp; None unless one has."""
        found = [(name, session) for other, name, session in self._stored[robot, stamp_ns] if other is not source]
        return found[0] if len(found) == 1 else None

    @cached_property
    def _stored(self) -> defaultdict[tuple[str, int], list[tuple[Source, str, int]]]:
        """By a robot's name in its store and a stamp: the store, and the robot and session in the merged one."""
        stored = defaultdict[tuple[str, int], list[tuple[Source, str, int]]](list)
        for source in self:
            for head in source.store.heads():
                one = source, source.names[head["robot"]], head["session"] + source.first.session
                stored[head["robot"], head["stamp_ns"]].append(one)
        return stored


@contextmanager
def open_sources(paths: Sequence[Path]) -> Iterator[Sources]:
    """The stores at ``paths``, which nobody writes meanwhile.

    StoreError for one that is none, damaged, of a newer version or in use. ValueError where two are the same store, or
    hold the same keyframes.
    """
    _refuse_same(paths)
    with ExitStack() as opened:
        stores = [_open(path, opened) for path in paths]
        _refuse_shared(paths, stores)
        heads = [list(store.heads()) for store in stores]
        names = robot_names(paths, [{head["robot"] for head in one} for one in heads])
        sources, first = Sources(), First()
        for path, store, of in zip(paths, stores, names, strict=True):
            sources.append(Source(path, store, first, of))
            first = First(
                first.keyframe + len(store.keyframe_ids()),
                first.session + store.next_session(),
                first.landmark + store.next_landmark() - 1,
            )
        yield sources


def _open(path: Path, opened: ExitStack) -> Store:
    if path.is_file():  # what is none is refused by the store
        opened.enter_context(unwritten_by_others(path))
    store = Store(path, read_only=True)
    opened.callback(store.close)
    return store


def _refuse_same(paths: Sequence[Path]) -> None:
    if len(paths) < 2:
        raise ValueError(f"expected two stores or more, got {len(paths)}")
    for one, other in combinations(paths, 2):
        if one.exists() and other.exists() and one.samefile(other):
            raise ValueError(f"expected different stores, got {one} and {other}, which are one file; name it once")


def _refuse_shared(paths: Sequence[Path], stores: Sequence[Store]) -> None:
    """Keyframes that are in two stores would be tied to themselves."""
    seen = [store.fingerprints() for store in stores]
    for (one, here), (other, there) in combinations(zip(paths, seen, strict=True), 2):
        if shared := len(here & there):
            raise ValueError(
                f"expected stores of different recordings, got {one} and {other}, which share {shared} keyframes: one "
                "is a copy of the other, or both are of one recording; leave one of them out"
            )
