# SPDX-License-Identifier: Apache-2.0
"""The store, its index and its landmarks know the same keyframes, also when they are read anew."""

from __future__ import annotations

import gc
from dataclasses import replace
from pathlib import Path

import numpy as np
from registration.samples import SECOND, box, candidate, keyframe

from objreg_ros.data.closures import Reason
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store import Store, StoreError
from objreg_ros.registrar.closure import Decision, waiting_of
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.recollection import Recollection
from objreg_ros.registration.candidate import ObjectPair
from objreg_ros.registration.keyframe import Keyframe

PARAMS = RegistrarParams()
THINGS = (box("cup", (0, 0, 1), instance=4), box("book", (0.4, 0, 1), instance=5))
STORED, NEW = keyframe(1, 0.0, THINGS), keyframe(2, 30.0, THINGS[::-1], session=1)
THEIRS = replace(NEW, keyframe_id=0, session=7, robot="b")
TURNED = (ObjectPair(0, 1, "book"), ObjectPair(1, 0, "cup"))  # the new one has them the other way round


def _accepted(target: Keyframe = STORED) -> Decision:
    return Decision(target=target, candidate=candidate(matched=TURNED))


def _begun(path: str = "") -> Recollection:
    recollection = Recollection(PARAMS, Store(path))
    recollection.remember(STORED, sightings_of(STORED), ())
    return recollection


def test_a_keyframe_that_closes_a_loop_has_the_landmarks_of_the_stored_one() -> None:
    recollection = _begun()
    (closure,), named = recollection.remember(NEW, sightings_of(NEW), [_accepted()])
    assert [sighting.landmark for sighting in named] == [2, 1]
    assert [(match.label, match.object_id) for match in closure.objects] == [("book", 2), ("cup", 1)]
    assert len(recollection.index) == 4 and len(recollection.landmarks) == 2
    assert len(list(recollection.store.closures())) == 1


def test_it_is_the_same_when_the_store_is_opened_again(tmp_path: Path) -> None:
    path = str(tmp_path / "place.db")
    before = _begun(path)
    before.remember(NEW, sightings_of(NEW), [_accepted()])
    before.store.close()
    after = Recollection(PARAMS, Store(path))
    assert len(after.index) == 4
    assert [one.sightings for one in after.landmarks.known()] == [one.sightings for one in before.landmarks.known()]
    after.store.close()


def test_a_closure_to_a_keyframe_of_others_goes_by_our_landmarks_and_leaves_them_as_they_are() -> None:
    recollection = _begun()
    (closure,) = recollection.remember_closures(THEIRS, [_accepted()])
    assert [(match.label, match.object_id) for match in closure.objects] == [("book", 2), ("cup", 1)]
    assert closure.robots == ("", "b") and (closure.from_session, closure.to_session) == (0, 7)
    assert recollection.store.keyframe_ids() == [1] and len(recollection.index) == 2
    assert [one.sightings for one in recollection.landmarks.known()] == [1, 1]


def test_objects_that_match_none_of_ours_have_no_landmark() -> None:
    only = Decision(target=STORED, candidate=candidate(matched=TURNED[:1]))
    assert [one.landmark for one in _begun().as_known(THEIRS, only)] == [2, 0]


def test_a_closure_to_others_holds_though_the_disk_is_full() -> None:
    recollection = _begun()

    def refuse(*_: object) -> None:
        raise StoreError("the disk is full")

    recollection.store.add_closure = refuse  # type: ignore[method-assign]
    assert len(recollection.remember_closures(THEIRS, [_accepted()])) == 1


def test_the_ties_of_a_camera_are_those_that_were_written_down() -> None:
    recollection = _begun()
    recollection.remember_closures(THEIRS, [_accepted()])
    assert recollection.ties_of(("b", "camera")) == [(0, 0, 30 * SECOND)]
    assert recollection.ties_of(("b", "rear")) == recollection.ties_of(("c", "camera")) == []


def test_a_late_closure_joins_what_it_says_is_one() -> None:
    recollection = _begun()
    _, named = recollection.remember(NEW, sightings_of(NEW), ())
    assert [one.landmark for one in named] == [3, 4]
    late = waiting_of(NEW, named, _accepted(), (Reason.NEIGHBOURS, "alone"), PARAMS)
    settled, ends = recollection.remember_late(late)
    assert ends is not None and [end.keyframe_id for end in ends] == [2, 1]
    assert [match.object_id for match in settled.closure.objects] == [2, 1] and len(recollection.landmarks) == 2


def test_a_late_closure_to_others_has_the_landmarks_of_the_stored_one_and_no_keyframes() -> None:
    recollection = _begun()
    named = tuple(one.of_landmark(0, np.eye(3)) for one in sightings_of(THEIRS))
    late = waiting_of(THEIRS, named, _accepted(), (Reason.NEIGHBOURS, "alone"), PARAMS)
    settled, ends = recollection.remember_late(late)
    assert ends is None and [match.object_id for match in settled.closure.objects] == [2, 1]
    assert len(list(recollection.store.closures())) == 1


def test_the_oldest_goes_from_all_of_them_when_there_are_too_many() -> None:
    recollection = _begun()
    recollection.params = PARAMS.replaced(max_keyframes=1)
    recollection.remember(NEW, sightings_of(NEW), ())
    assert recollection.store.keyframe_ids() == [2] and len(recollection.index) == 2
    assert [one.session for one in recollection.landmarks.known()] == [1, 1]


def test_of_many_keyframes_only_those_used_last_are_in_memory_and_the_others_are_read_back() -> None:
    recollection = Recollection(PARAMS, Store())
    recollection.store._recent.most_bytes = 3 * STORED.nbytes
    for k in range(20):
        passing = replace(keyframe(k + 1, 10.0 * k, THINGS, session=k), robot="passing")
        recollection.remember(passing, sightings_of(passing), ())
    del passing
    gc.collect()
    alive = [one for one in gc.get_objects() if isinstance(one, Keyframe) and one.robot == "passing"]
    assert sorted(one.keyframe_id for one in alive) == [18, 19, 20]
    assert len(recollection.index) == 40 and len(recollection.landmarks) == 40
    back = recollection.store.keyframe(1)
    assert all(np.array_equal(a.cloud.xyz, b.cloud.xyz) for a, b in zip(back.objects, STORED.objects, strict=True))
