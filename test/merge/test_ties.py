# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from registration.samples import box, keyframe
from report.places import store_of, tying

from merge.stores import PARAMS, two_stores
from objreg_ros.data.closures import ObjectMatch, Reason
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store import Store
from objreg_ros.registrar.closure import WaitingClosure
from objreg_ros.registrar.consistency import Standpoint
from objreg_tools.merge import ties
from objreg_tools.merge.merging import merge
from objreg_tools.merge.ties import FoundTies, Leg, Tying, legs_of


def cups(sessions: int, *each: tuple[str, ...]) -> Store:
    """One keyframe a session, with objects of these labels, each a landmark of its own."""
    store = Store()
    for session in range(sessions):
        labels = each[session] if each else ("cup",)
        objects = tuple(box(label, (0.3 * k, 0, 1), instance=k + 1) for k, label in enumerate(labels))
        one = keyframe(session + 1, float(session), objects, session)
        first = store.next_landmark()
        store.write_keyframe(one, [replace(s, landmark=first + k) for k, s in enumerate(sightings_of(one))])
    return store


def waiting(source: int, target: int, instances: tuple[int, ...] = (1,)) -> WaitingClosure:
    """A closure from the keyframe of one session to that of another, by objects of these instances in both."""
    closure = tying(float(target), float(source), target, source, 0.0)
    matches = tuple(ObjectMatch(label="cup", object_id=99) for _ in instances)
    return WaitingClosure(
        closure=replace(closure, objects=matches),
        refusal=(Reason.CAMERA, ""),
        accepted=True,
        source_id=source + 1,
        target_id=target + 1,
        pairs=tuple((k, k) for k in instances),
        R_there_here=np.eye(3),
        here=Standpoint(closure.to_ns, closure.to_session or 0, np.eye(4), 0.0),
        there=Standpoint(closure.from_ns, closure.from_session or 0, np.eye(4), 0.0),
    )


def test_keyframes_are_searched_for_in_the_stores_before_their_own() -> None:
    legs = legs_of(cups(4), [[0], [1, 2], [3]])
    assert legs == [
        Leg(1, (2,), frozenset({1, 2, 3})),
        Leg(2, (3,), frozenset({1, 2, 3})),
        Leg(3, (4,), frozenset({3})),
    ]


def test_a_long_session_has_several_legs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(ties, "LEG", 2)
    shown = [(float(k), int(k > 0), (box("cup", (0, 0, 1)),)) for k in range(6)]
    store = Store(store_of(tmp_path / "s.db", shown), read_only=True)
    assert [leg.keyframe_ids for leg in legs_of(store, [[0], [1]])] == [(2, 3), (4, 5), (6,)]
    store.close()


def test_objects_that_a_closure_joins_are_one_from_then_on_also_over_several_closures() -> None:
    store = cups(3)
    found = FoundTies(PARAMS, store)
    for source, target in ((2, 1), (1, 0)):  # 3 becomes 2, which becomes 1
        found.remember_late(waiting(source, target))
    assert found.found() == 2 and found.write() == 2 and found.found() == 0
    assert [sighting.landmark for sighting in store.sightings()] == [1, 1, 1]
    assert [closure.objects[0].object_id for closure in store.closures()] == [2, 1]
    assert store.next_closure() == 3


def test_two_objects_of_one_keyframe_stay_two() -> None:
    store = cups(3, ("cup", "cup"), ("cup",), ("cup", "cup"))
    found = FoundTies(PARAMS, store)
    found.remember_late(waiting(1, 0))  # 3 becomes 1
    swapped = replace(waiting(2, 1), pairs=((2, 1),))  # 5 becomes 1
    found.remember_late(swapped)
    found.remember_late(waiting(2, 0))  # 4 would become 1, beside which it is seen
    found.write()
    landmarks = [sighting.landmark for sighting in store.sightings()]
    assert landmarks == [1, 2, 1, 4, 1]


def test_what_is_tied_already_is_known_from_both_ends() -> None:
    store = cups(2)
    store.add_closure(tying(0.0, 1.0, 0, 1, 0.0), {})
    found = FoundTies(PARAMS, store)
    assert found.pairs_of(1) == [(0, 0, 10**9)] and found.pairs_of(0) == [(1, 10**9, 0)]


def test_a_keyframe_that_is_tied_already_is_not_tied_again(tmp_path: Path) -> None:
    paths = two_stores(tmp_path)
    place = merge(paths, tmp_path / "both.db", PARAMS).path
    store = Store(place)
    tying_again = Tying(store, PARAMS)
    (leg,) = legs_of(store, [[0], [1]])
    counts = list(tying_again.search(leg))
    assert sum(one["closures"] for one in counts) == 0 == tying_again.found()
    assert sum(one["refused: redundant"] for one in counts) > 0
    tying_again.close()
    store.close()
