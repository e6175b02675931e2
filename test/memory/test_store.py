# SPDX-License-Identifier: Apache-2.0
"""The store: what is written is there, what is foreign is left alone, kill -9 takes nothing acknowledged."""

from __future__ import annotations

import errno
import os
import random
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from registration.samples import box, keyframe, moved

from objreg_ros.data.closure_id import identity_of
from objreg_ros.data.closures import LoopClosure
from objreg_ros.geometry import rotation_from_vector
from objreg_ros.memory.codec import pack
from objreg_ros.memory.counters import MOST_IDS
from objreg_ros.memory.landmarks import Merge
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store import Store, StoreError
from objreg_ros.memory.store_file import CACHE_KB
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.registrar import Registrar

WRITER = """
import sys
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store import Store
from samples import keyframe
store = Store(sys.argv[1])
while True:
    number = store.next_keyframe()
    written = keyframe(number, float(number))
    store.write_keyframe(written, sightings_of(written))
    print(number, flush=True)
"""


def _add(store: Store, seconds: float = 0.0, **kwargs: object) -> int:
    written = keyframe(store.next_keyframe(), seconds, **kwargs)
    store.write_keyframe(written, sightings_of(written))
    return written.keyframe_id


def test_a_keyframe_comes_back_as_it_went_in(tmp_path: Path) -> None:
    with_pose = keyframe(1, 3.5, objects=(box("cup", (0, 0, 1)), box("book", (0.3, 0, 1), instance=2)))
    store = Store(tmp_path / "place.db")
    store.write_keyframe(with_pose, sightings_of(with_pose))
    store.close()
    back = Store(tmp_path / "place.db").keyframe(1)
    assert (back.stamp_ns, back.session, back.labels, back.frame_id) == (3_500_000_000, 0, ("cup", "book"), "camera")
    assert np.array_equal(back.objects[1].cloud.xyz, with_pose.objects[1].cloud.xyz)
    assert np.array_equal(back.objects[1].cloud.rgb, with_pose.objects[1].cloud.rgb)
    assert np.array_equal(back.context.xyz, with_pose.context.xyz)
    assert np.array_equal(back.view.grey, with_pose.view.grey)
    assert np.allclose(back.view.xyz, with_pose.view.xyz, atol=1e-5)
    assert np.array_equal(back.T_odom_camera, np.eye(4)) and np.array_equal(back.gravity, (0, 1, 0))


def test_a_temporary_store_needs_no_file() -> None:
    store = Store()
    number = _add(store)
    assert store.keyframe(number).labels == ("cup",) and store.counts()["objects"] == 1


def test_sightings_come_back_with_landmark_position_and_descriptor(tmp_path: Path) -> None:
    store = Store(tmp_path / "place.db")
    written = replace(
        keyframe(1, objects=(box("cup", (0.2, 0, 1)),), T_odom_camera=moved(1.0)), travelled=0.5, turned=7.0
    )
    (sighting,) = sightings_of(written)
    store.write_keyframe(written, [sighting.of_landmark(7, np.eye(3))])
    (back,) = store.sightings()
    assert (back.landmark, back.label, back.travelled) == (7, "cup", 0.5)
    assert (store.keyframe(1).travelled, store.keyframe(1).turned) == (0.5, 7.0)
    assert np.allclose(back.position, (1.2, 0, 1), atol=0.02) and np.allclose(back.camera, (1, 0, 0))
    assert np.array_equal(back.descriptor, sighting.descriptor)


def test_ids_and_sessions_go_on_and_are_never_used_again(tmp_path: Path) -> None:
    store = Store(tmp_path / "place.db")
    first, second = _add(store), _add(store, session=4)
    store.remove([second])
    store.close()
    store = Store(tmp_path / "place.db")
    assert (first, store.next_keyframe(), store.next_session()) == (1, 3, 1)
    assert store.keyframe_ids() == [first]


def test_an_unknown_keyframe_is_a_key_error() -> None:
    with pytest.raises(KeyError):
        Store().keyframe(5)


def test_merged_landmarks_are_written_in_the_axes_of_the_one_that_stays() -> None:
    store, turn = Store(), rotation_from_vector(np.array([0.0, 0.0, 0.5]))
    written = keyframe(1)
    store.write_keyframe(written, [sightings_of(written)[0].of_landmark(9, turn)])
    later = keyframe(2, 5.0)
    merged = {9: Merge(into=2, R_into_old=turn)}
    store.write_keyframe(later, [sightings_of(later)[0].of_landmark(2, np.eye(3))], merged=merged)
    first, second = store.sightings()
    assert (first.landmark, second.landmark) == (2, 2)
    assert np.allclose(first.R_landmark_session, turn @ turn) and np.array_equal(second.R_landmark_session, np.eye(3))


def test_a_closure_comes_back_with_its_covariance(tmp_path: Path) -> None:
    store = Store(tmp_path / "place.db")
    closure = LoopClosure(
        from_ns=1, to_ns=2, T_from_to=moved(0.3), covariance=0.01 * np.eye(6), labels=("cup",), evidence={"score": 0.5}
    )
    written = keyframe(1)
    store.write_keyframe(written, sightings_of(written), [closure])
    store.close()
    (back,) = Store(tmp_path / "place.db").closures()
    assert np.array_equal(back.T_from_to, closure.T_from_to) and np.array_equal(back.covariance, closure.covariance)
    assert (back.labels, back.evidence) == (("cup",), {"score": 0.5})


def test_the_id_of_a_landmark_is_never_used_again(tmp_path: Path) -> None:
    path, written = tmp_path / "place.db", keyframe(1)
    store = Store(path)
    assert store.next_landmark() == 1
    store.write_keyframe(written, [sightings_of(written)[0].of_landmark(7, np.eye(3))])
    store.remove([1])
    store.close()
    opened = Store(path)
    opened.clear()
    assert opened.next_landmark() == 8


def test_what_the_database_refuses_later_is_a_store_error_too(tmp_path: Path) -> None:
    store = Store(tmp_path / "place.db")
    number = _add(store)
    store.close()
    for refused in (store.clear, store.counts, lambda: store.remove([number])):
        with pytest.raises(StoreError, match=r"place\.db: cannot"):
            refused()


def test_what_cannot_be_written_is_a_store_error_and_leaves_the_store_as_it_was() -> None:
    store = Store()
    number = _add(store)
    twice = keyframe(number)
    with pytest.raises(StoreError, match="cannot write keyframe 1"):
        store.write_keyframe(twice, sightings_of(twice))
    assert store.counts()["objects"] == 1


def test_the_oldest_keyframes_are_those_beyond_a_number() -> None:
    store = Store()
    numbers = [_add(store, float(i)) for i in range(5)]
    assert store.beyond(3) == numbers[:2] and store.beyond(9) == []


def test_the_oldest_are_known_when_a_store_is_opened_again(tmp_path: Path) -> None:
    store = Store(tmp_path / "place.db")
    numbers = [_add(store, float(i)) for i in range(5)]
    store.close()
    assert Store(tmp_path / "place.db").beyond(3) == numbers[:2]


def test_what_was_removed_is_neither_there_nor_counted() -> None:
    store = Store()
    first, second = _add(store), _add(store, session=1)
    store.remove([second])
    with pytest.raises(KeyError):
        store.keyframe(second)
    assert (store.keyframe_ids(), store.counts()["keyframes"], store.counts()["objects"]) == ([first], 1, 1)
    assert (store.counts()["sessions"], store.next_session()) == (1, 1)


def test_objects_of_one_landmark_are_counted_as_one() -> None:
    store = Store()
    for number, landmark in ((1, 7), (2, 7), (3, 9)):
        written = keyframe(number, float(number))
        store.write_keyframe(written, [sightings_of(written)[0].of_landmark(landmark, np.eye(3))])
    assert (store.counts()["objects"], store.counts()["landmarks"]) == (3, 2)


def test_sessions_that_may_have_reached_a_moment_are_those_up_to_the_last_that_did() -> None:
    store = Store()
    for session, seconds in ((0, 30.0), (1, 20.0), (2, 40.0)):
        _add(store, seconds, session=session)
    reached = {
        s: [set(store.sessions_beyond("", k, round(s * 1e9))) for k in (0, 1, 2, 3)] for s in (15, 25, 30, 35, 45)
    }
    assert reached == {
        15: [set(), {0}, {0, 1}, {0, 1, 2}],
        25: [set(), {0}, {0}, {0, 1, 2}],
        30: [set(), {0}, {0}, {0, 1, 2}],
        35: [set(), set(), set(), {0, 1, 2}],
        45: [set(), set(), set(), set()],
    }
    assert store.sessions_beyond("robot1", 3, 0) == frozenset()


def test_sessions_of_keyframers_elsewhere_are_known_by_their_origin() -> None:
    store = Store()
    for number, (seconds, session, origin) in enumerate(
        ((5.0, 3, "a/0"), (7.0, 3, "a/0"), (6.0, 4, "a/1"), (9.0, 5, ""))
    ):
        written = replace(keyframe(number + 1, seconds, session=session), robot="robot1", origin=origin)
        store.write_keyframe(written, sightings_of(written))
    known = store.origins()
    assert known == {"a/0": (3, 7 * 10**9), "a/1": (4, 6 * 10**9)}


def test_clearing_forgets_all_but_the_ids() -> None:
    store = Store()
    _add(store)
    store.clear()
    assert set(store.counts().values()) == {0} and store.next_keyframe() == 2


def test_a_copy_of_a_temporary_store_can_be_saved(tmp_path: Path) -> None:
    store = Store()
    _add(store)
    store.save(tmp_path / "copy.db")
    assert Store(tmp_path / "copy.db").counts()["keyframes"] == 1


def test_a_temporary_store_is_not_saved_without_a_path() -> None:
    store = Store()
    _add(store)
    with pytest.raises(StoreError, match=r"temporary store: cannot save it: .* got a temporary one"):
        store.save()


def test_a_store_that_is_read_is_not_said_to_be_folded_but_its_copy_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "place.db"
    store = Store(path)
    _add(store)
    assert store.save() == str(path)
    store._connection.execute("PRAGMA busy_timeout = 10")
    with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as reader:
        reader.execute("BEGIN")
        reader.execute("SELECT COUNT(*) FROM keyframe").fetchone()
        _add(store)
        with pytest.raises(StoreError, match=r"place\.db-wal is not in place\.db yet: end that program and save again"):
            store.save()
        store.save(tmp_path / "copy.db")
    copy = Store(tmp_path / "copy.db", read_only=True)
    assert copy.keyframe_ids() == [1, 2] and store.save() == str(path)


def test_a_copy_never_goes_where_a_registrar_writes(tmp_path: Path) -> None:
    store, other = Store(tmp_path / "place.db"), Store(tmp_path / "other.db")
    for path in (tmp_path / "place.db", tmp_path / "other.db"):
        with pytest.raises(StoreError, match="in use by another registrar"):
            store.save(path)
    other.close()


def test_a_store_that_was_saved_is_whole_without_the_log_beside_it(tmp_path: Path) -> None:
    store = Store(tmp_path / "place.db")
    _add(store)
    assert store.save() == str(tmp_path / "place.db")
    shutil.copy(tmp_path / "place.db", tmp_path / "alone.db")
    assert Store(tmp_path / "alone.db").counts()["keyframes"] == 1


def test_only_the_last_keyframes_stay_in_memory() -> None:
    store = Store()
    store._recent.most_bytes = 3 * keyframe().nbytes
    numbers = [_add(store, float(i)) for i in range(6)]
    first = [store.keyframe(number) for number in numbers]
    assert [store.keyframe(number) is was for number, was in zip(numbers[3:], first[3:], strict=True)] == [True] * 3
    assert [store.keyframe(number) is was for number, was in zip(numbers[:3], first[:3], strict=True)] == [False] * 3
    assert store._recent.nbytes <= store._recent.most_bytes


def test_what_makes_a_store_too_large_is_found_by_its_size_the_oldest_first(tmp_path: Path) -> None:
    with closing(Store(tmp_path / "place.db")) as store:
        numbers = [_add(store, float(i)) for i in range(12)]
        store.save()
        size = (tmp_path / "place.db").stat().st_size
        assert store.beyond(12, size) == [] and store.beyond(10, size) == numbers[:2]
        beyond = store.beyond(12, 0.5 * size)
        assert numbers[:5] <= beyond <= numbers[:8]
        store.remove(beyond, forgotten=len(beyond))
        assert store.beyond(12, 0.5 * size) == []
        assert store.beyond(12, 1.0) == store.keyframe_ids()[:-1]


def test_a_store_that_is_only_read_is_not_changed(tmp_path: Path) -> None:
    path = tmp_path / "place.db"
    store = Store(path)
    _add(store)
    store.close()
    before = path.read_bytes()
    reader = Store(path, read_only=True)
    assert reader.keyframe(1).labels == ("cup",)
    with pytest.raises(StoreError, match="readonly"):
        _add(reader)
    reader.close()
    assert path.read_bytes() == before and [p.name for p in tmp_path.iterdir()] == ["place.db"]


def test_who_reads_sees_one_moment_whatever_is_written_and_removed_meanwhile(tmp_path: Path) -> None:
    store = Store(tmp_path / "place.db")
    first, second = _add(store), _add(store, 1.0)
    reader = Store(tmp_path / "place.db", read_only=True)
    store.remove([first])
    _add(store, 2.0)
    assert [reader.keyframe(k).keyframe_id for k in reader.keyframe_ids()] == [first, second]
    assert reader.counts()["objects"] == 2
    reader.close()
    store.close()


def test_a_link_to_a_store_that_is_not_there_yet_stays_a_link_and_nobody_else_opens_it(tmp_path: Path) -> None:
    link, path = tmp_path / "link.db", tmp_path / "disk" / "place.db"
    path.parent.mkdir()
    link.symlink_to(path)
    store = Store(link)
    _add(store)
    assert link.is_symlink() and path.is_file()
    with pytest.raises(StoreError, match="in use by another registrar"):
        Store(path)
    store.close()


def test_closures_are_counted_over_restarts_and_outlive_their_keyframes(tmp_path: Path) -> None:
    closure = LoopClosure(from_ns=1, to_ns=2, T_from_to=np.eye(4), covariance=np.eye(6), labels=("cup",))
    for total in (2, 4):
        store = Store(tmp_path / "place.db")
        written = keyframe(store.next_keyframe(), float(total))
        store.write_keyframe(written, sightings_of(written), [closure, closure])
        store.remove([written.keyframe_id])
        assert store.counts()["closures"] == total == len(list(store.closures()))
        store.close()


def test_the_oldest_closures_make_room(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("objreg_ros.memory.store.MOST_CLOSURES", 3)
    store = Store()
    for k in range(4):
        closures = [
            LoopClosure(from_ns=n, to_ns=n + 1, T_from_to=np.eye(4), covariance=np.eye(6), labels=("cup",))
            for n in (2 * k, 2 * k + 1)
        ]
        written = keyframe(store.next_keyframe(), float(k))
        store.write_keyframe(written, sightings_of(written), closures)
    assert [closure.from_ns for closure in store.closures()] == [5, 6, 7] and store.counts()["closures"] == 3


def test_a_second_writer_is_refused_while_readers_see_what_is_written(tmp_path: Path) -> None:
    path = tmp_path / "place.db"
    store = Store(path)
    _add(store)
    with pytest.raises(StoreError, match=r"place\.db: in use by another registrar"):
        Store(path)
    reader = Store(path, read_only=True)
    assert _add(store) == 2 and reader.keyframe(1).labels == ("cup",)
    reader.close()
    store.save(tmp_path / "copy.db")
    Store(tmp_path / "copy.db").close()
    store.close()
    again = Store(path)
    assert again.keyframe_ids() == [1, 2]
    again.close()


def test_a_store_that_was_refused_is_in_nobodys_way(tmp_path: Path) -> None:
    path = tmp_path / "place.db"
    path.write_text("nothing like a store\n" * 20)
    with pytest.raises(StoreError, match="another kind"):
        Store(path)
    path.unlink()
    Store(path).close()


def test_a_missing_store_is_not_made_by_reading(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="got no file"):
        Store(tmp_path / "nothing.db", read_only=True)
    assert not list(tmp_path.iterdir())


def test_a_damaged_blob_is_reported_when_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "place.db"
    store = Store(path)
    number = _add(store)
    store._connection.execute("UPDATE scene SET context = x'00ff00'")
    store._recent.clear()
    with pytest.raises(StoreError, match=r"keyframe 1: .*damaged"):
        store.keyframe(number)


NAN = np.full(16, np.nan)
DAMAGED_OBJECTS: dict[str, object] = {
    "descriptor": b"\0" * 40,
    "position": NAN[:3].tobytes(),
    "camera": b"\0",
    "label": b"\xff",
    "score": 0.25,
    "R_landmark_session": NAN[:9].tobytes(),
    "landmark": 7,
    "instance": "one",
    "density": 2e4,
    "checksum": 5,
}
DAMAGED_SCENES: dict[str, object] = {"view": b"\0", "context": b"", "checksum": 7}
DAMAGED_KEYFRAMES: dict[str, object] = {
    "session": 3,
    "stamp_ns": 5,
    "travelled": 1.0,
    "by_odometry": 2,
    "camera": '{"f": 1}',
    "gravity": NAN[:3].tobytes(),
    "T_odom_camera": NAN.tobytes(),
    "turned": 3.0,
    "frame_id": "other",
    "gravity_confidence": 0.5,
    "checksum": 1,
}
DAMAGED_CLOSURES: dict[str, object] = {"fields": '{"from_ns": 9}', "to_session": 9}
CLOSURE = LoopClosure(from_ns=1, to_ns=2, T_from_to=np.eye(4), covariance=np.eye(6), labels=("cup",))


def _damaged(path: Path, table: str, column: str, value: object) -> bytes:
    """A store with two keyframes, the first of which holds ``value``; what the file holds."""
    store = Store(path)
    for seconds in (0.0, 5.0):
        written = keyframe(store.next_keyframe(), seconds)
        store.write_keyframe(written, sightings_of(written), [CLOSURE])
    with store._connection as transaction:
        transaction.execute(f"UPDATE {table} SET {column} = ? WHERE id = 1", (value,))
    store.close()
    return path.read_bytes()


@pytest.mark.parametrize("column", DAMAGED_OBJECTS)
def test_a_damaged_object_is_named_with_its_file_and_nothing_is_touched(tmp_path: Path, column: str) -> None:
    path = tmp_path / "place.db"
    before = _damaged(path, "object", column, DAMAGED_OBJECTS[column])
    whose = "one" if column == "instance" else "1"
    for _ in range(2):  # the first is in nobody's way
        expected = rf"place\.db: .*object '?{whose}'? of keyframe 1: expected the checksum .* or another path"
        with pytest.raises(StoreError, match=expected):
            Registrar(RegistrarParams(store=str(path)))
    assert path.read_bytes() == before and [p.name for p in tmp_path.iterdir()] == ["place.db"]


@pytest.mark.parametrize("column", DAMAGED_SCENES)
def test_a_damaged_view_is_reported_when_it_is_read_and_the_others_are_not(tmp_path: Path, column: str) -> None:
    path = tmp_path / "place.db"
    _damaged(path, "scene", column, DAMAGED_SCENES[column])
    store = Store(path)
    with pytest.raises(StoreError, match=r"place\.db: cannot read keyframe 1: .* it is damaged"):
        store.keyframe(1)
    assert store.keyframe(2).labels == ("cup",)
    store.close()


@pytest.mark.parametrize("column", DAMAGED_KEYFRAMES)
def test_a_damaged_keyframe_is_refused_at_the_opening(tmp_path: Path, column: str) -> None:
    path = tmp_path / "place.db"
    before = _damaged(path, "keyframe", column, DAMAGED_KEYFRAMES[column])
    with pytest.raises(StoreError, match=r"place\.db: cannot open: .*damaged.* or another path"):
        Store(path)
    assert path.read_bytes() == before and [p.name for p in tmp_path.iterdir()] == ["place.db"]


def test_the_points_of_an_object_are_those_that_were_written_with_it(tmp_path: Path) -> None:
    path = tmp_path / "place.db"
    _damaged(path, "cloud", "points", pack(*[np.zeros((3, 3), np.float32)] * 2, None, np.zeros(3, np.uint16)))
    with closing(Store(path)) as store:
        with pytest.raises(StoreError, match=r"keyframe 1: the points of object 1: .* it is damaged"):
            store.keyframe(1)
        assert len(list(store.sightings())) == 2


@pytest.mark.parametrize("column", DAMAGED_CLOSURES)
def test_a_damaged_closure_is_refused_in_one_line(tmp_path: Path, column: str) -> None:
    path = tmp_path / "place.db"
    _damaged(path, "closure", column, DAMAGED_CLOSURES[column])
    with closing(Store(path)) as store, pytest.raises(StoreError, match=r"place\.db: .* closure 1: .* damaged$"):
        list(store.closures())


CHANGES = {
    "no object": "DELETE FROM object WHERE id = 1",
    "no closure": "DELETE FROM closure WHERE id = 2",
    "no keyframe": "DELETE FROM object WHERE keyframe = 1; DELETE FROM keyframe WHERE id = 1",
    "an object twice": "INSERT INTO object SELECT 9, keyframe, instance, landmark, label, score, extent, sightings,"
    " density, position, camera, R_landmark_session, descriptor, checksum FROM object WHERE id = 1",
    "no counters": "DELETE FROM counters",
    "other counters": "UPDATE counters SET landmark = 0, keyframe = 'many'",
    "a trigger": "CREATE TRIGGER t AFTER INSERT ON keyframe BEGIN DELETE FROM object; END",
    "a view": "CREATE VIEW v AS SELECT * FROM keyframe",
    "a table": "CREATE TABLE t (a)",
    "a column": "ALTER TABLE closure ADD COLUMN more TEXT",
    "no index": "DROP INDEX object_of_keyframe",
    "no version": "PRAGMA user_version = 0",
}


@pytest.mark.parametrize("what", CHANGES)
def test_what_no_registrar_wrote_is_refused_in_one_line_and_left_untouched(tmp_path: Path, what: str) -> None:
    path = tmp_path / "place.db"
    _damaged(path, "keyframe", "id", 1)
    with closing(sqlite3.connect(path)) as connection:
        connection.executescript(CHANGES[what])
    before = path.read_bytes()
    for read_only in (False, True):
        with pytest.raises(StoreError, match=r"^[^\n]*place\.db: [^\n]*expected [^\n]* it was left as it is[^\n]*$"):
            Store(path, read_only=read_only)
    assert path.read_bytes() == before and [p.name for p in tmp_path.iterdir()] == ["place.db"]


@pytest.mark.parametrize("what", ["keyframe", "landmark", "object", "closure"])
def test_ids_that_are_used_up_are_a_store_error(what: str) -> None:
    store = Store()
    setattr(store._counters, what, MOST_IDS[what])
    written = keyframe(1)
    with pytest.raises(StoreError, match=f"expected ids of {what}s up to .*: they are used up"):
        if what in ("keyframe", "landmark"):
            getattr(store, f"next_{what}")()
        store.write_keyframe(written, sightings_of(written), [CLOSURE])


def test_the_file_shrinks_by_steps_where_many_keyframes_go(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("objreg_ros.memory.store_file.SPARE", 20)
    monkeypatch.setattr("objreg_ros.memory.store.STEP", 100)
    path = tmp_path / "place.db"
    with closing(Store(path)) as store:
        numbers = [_add(store, float(k)) for k in range(12)]
        full = path.stat().st_size
        store.remove(numbers[:10], forgotten=10)
        assert full - 102 * 4096 <= path.stat().st_size <= full - 98 * 4096
        for _ in range(20):
            store.remove([])
        assert path.stat().st_size < full / 3 and store.counts()["forgotten"] == 10
        assert [store.keyframe(k).keyframe_id for k in store.keyframe_ids()] == numbers[10:]
    with closing(Store(path)) as store:
        assert store.counts()["forgotten"] == 10
        store.clear()
        assert path.stat().st_size < full / 6


def test_a_store_in_a_file_is_put_aside_whole_not_emptied(tmp_path: Path) -> None:
    path = tmp_path / "place.db"
    with closing(Store(path)) as store:
        _add(store)
        aside = Path(store.clear())
        assert aside.parent == tmp_path and re.fullmatch(r"place-\d{8}-\d{6}\.db", aside.name)
        assert store.counts()["keyframes"] == 0 and store.next_keyframe() == 2
        assert store.clear() == ""  # nothing is in it
        _add(store)
        assert Path(store.clear()) != aside
        with closing(Store(aside)) as before:
            assert before.keyframe_ids() == [1]
        with pytest.raises(StoreError, match="in use by another registrar"):
            Store(path)
    with closing(Store(path)) as store:
        assert store.keyframe_ids() == [] and store.next_keyframe() == 3
    assert len(list(tmp_path.glob("place-*.db"))) == 2 and not list(tmp_path.glob("*.new*"))


def test_a_store_that_cannot_be_put_aside_stays_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with closing(Store(tmp_path / "place.db")) as store:
        _add(store)
        for what in ("create", "dated_link"):
            with (
                monkeypatch.context() as patch,
                pytest.raises(StoreError, match=r"place\.db: cannot set it aside: .*space"),
            ):
                patch.setattr(f"objreg_ros.memory.store.{what}", full)
                store.clear()
            assert store.keyframe_ids() == [1] and store.counts()["keyframes"] == 1
            assert not list(tmp_path.glob("place-*")) and not list(tmp_path.glob("*.new*"))
        assert _add(store) == 2


def test_where_a_file_has_one_name_only_what_is_put_aside_is_a_copy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(errno.EPERM, os.strerror(errno.EPERM))

    monkeypatch.setattr(os, "link", refuse)
    with closing(Store(tmp_path / "place.db")) as store:
        _add(store)
        with closing(Store(store.clear())) as before:
            assert before.keyframe(1).labels == ("cup",)


def test_nothing_hangs_on_the_log_alone(tmp_path: Path) -> None:
    with closing(Store(tmp_path / "place.db")) as store:
        _add(store)
        shutil.copy(tmp_path / "place.db", tmp_path / "alone.db")
    with closing(Store(tmp_path / "alone.db")) as alone:
        assert alone.keyframe(1).labels == ("cup",)


def test_a_second_writer_is_refused_by_a_hard_link_and_beside_whatever_was_deleted(tmp_path: Path) -> None:
    path, link = tmp_path / "place.db", tmp_path / "elsewhere" / "link.db"
    store = Store(path)
    link.parent.mkdir()
    link.hardlink_to(path)
    for beside in tmp_path.glob("*.lock"):
        beside.unlink()
    for name in (path, link):
        with pytest.raises(StoreError, match="in use by another registrar"):
            Store(name)
    assert _add(store) == 1
    store.close()


@pytest.mark.parametrize("log", [False, True])
def test_a_flipped_bit_is_harmless_or_one_line(tmp_path: Path, repository: Path, log: bool) -> None:
    path = tmp_path / "place.db"
    with closing(Store(path)) as store:
        for k in range(3):
            written = keyframe(k + 1, 10.0 * k, (box("cup", (0, 0, 1)), box("book", (0.5, 0, 1), instance=2)))
            store.write_keyframe(written, sightings_of(written), [CLOSURE])
        if log:
            (tmp_path / "killed").mkdir()
            for name in ("place.db", "place.db-wal"):
                shutil.copy(tmp_path / name, tmp_path / "killed" / name)
            path = tmp_path / "killed" / "place.db"
    sys.path.append(str(repository / "benchmarks"))
    try:
        from store_flips import flip_store
    finally:
        sys.path.pop()
    counts, faults = flip_store(path, 60, tmp_path / "copies", random.randrange(2**32))
    assert not faults and sum(counts.values()) == 60


def test_two_processes_killed_at_any_moment_lose_nothing_acknowledged(tmp_path: Path, repository: Path) -> None:
    path, draw = tmp_path / "place.db", random.Random(5)
    places = (repository, repository / "test" / "registration")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, places))}
    acknowledged: set[int] = set()
    for _ in range(2):
        writer = subprocess.Popen(
            [sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, text=True, env=environment
        )
        assert writer.stdout is not None
        acknowledged.add(int(writer.stdout.readline()))
        time.sleep(draw.uniform(0.0, 0.2))
        writer.send_signal(signal.SIGKILL)
        acknowledged.update(int(line) for line in writer.stdout.read().split("\n")[:-1])
        writer.wait()
        writer.stdout.close()
        store = Store(path)
        assert acknowledged <= set(store.keyframe_ids())
        assert all(store.keyframe(number).labels == ("cup",) for number in store.keyframe_ids())
        store.close()


def test_a_late_closure_is_written_and_renames_the_landmarks_that_it_joins(tmp_path: Path) -> None:
    store = Store(tmp_path / "place.db")
    for number in (1, 2):
        stored = keyframe(number, number)
        store.write_keyframe(stored, [seen.of_landmark(number, np.eye(3)) for seen in sightings_of(stored)])
    late = LoopClosure(from_ns=1, to_ns=2, T_from_to=moved(0.3), covariance=np.eye(6), labels=("cup",))
    store.add_closure(late, {2: Merge(into=1, R_into_old=np.eye(3))})
    store.close()
    again = Store(tmp_path / "place.db")
    assert [closure.from_ns for closure in again.closures()] == [1] and again.counts()["closures"] == 1
    assert {sighting.landmark for sighting in again.sightings()} == {1}


def test_a_temporary_store_keeps_keyframes_on_the_disk_and_reads_back_what_was_put_in() -> None:
    store = Store()
    store._recent.most_bytes = 1
    assert store._connection.execute("PRAGMA database_list").fetchone()["file"] == ""
    assert store._connection.execute("PRAGMA cache_size").fetchone()[0] == -CACHE_KB
    written = keyframe(1)
    store.write_keyframe(written, sightings_of(written))
    for _ in range(3):
        _add(store)
    back = store.keyframe(1)
    assert back is not written and back.labels == written.labels
    assert np.array_equal(back.objects[0].cloud.xyz, written.objects[0].cloud.xyz)
    assert np.allclose(back.view.xyz, written.view.xyz, atol=1e-5)


def test_heads_poses_and_fingerprints_are_known_without_reading_a_keyframe(tmp_path: Path) -> None:
    store = Store(tmp_path / "s.db")
    one = replace(keyframe(1, 3.5, session=2), robot="robot1", T_odom_camera=moved(0.5), travelled=1.5)
    store.write_keyframe(one, sightings_of(one))
    (head,), ((number, T),) = store.heads(), store.poses()
    assert (head["id"], head["session"], head["robot"], head["travelled"]) == (1, 2, "robot1", 1.5)
    assert number == 1 and T is not None and (moved(0.5) == T).all()
    again = Store()
    again.write_keyframe(replace(one, keyframe_id=9, session=7), sightings_of(replace(one, keyframe_id=9, session=7)))
    assert store.fingerprints() == again.fingerprints()
    again.write_keyframe(replace(one, keyframe_id=10, travelled=1.6), sightings_of(replace(one, keyframe_id=10)))
    assert len(again.fingerprints() - store.fingerprints()) == 1
    store.close()


def test_closures_that_are_written_together_are_all_there_or_none(tmp_path: Path) -> None:
    store = Store(tmp_path / "s.db")
    closure = LoopClosure(from_ns=1, to_ns=2, T_from_to=np.eye(4), covariance=np.eye(6), labels=("cup",))

    def broken() -> Iterator[tuple[LoopClosure, dict[int, Merge]]]:
        yield closure, {}
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(StoreError, match="No space left"):
        store.add_closures(broken())
    assert store.counts()["closures"] == 0 and store.next_closure() == 1
    store.add_closures([(closure, {}), (closure, {})])
    assert store.counts()["closures"] == 2 and store.next_closure() == 3
    store.close()


def test_where_a_keyframe_stood_is_known_without_its_view(tmp_path: Path) -> None:
    path = tmp_path / "place.db"
    store = Store(path)
    written = replace(keyframe(1, 5.0, session=3), T_odom_camera=moved(2.0), travelled=7.5)
    store.write_keyframe(written, sightings_of(written))
    with store._connection as transaction:
        transaction.execute("UPDATE scene SET checksum = 0")
    store.close()
    store = Store(path)
    stand = store.stand_at(3, written.stamp_ns)
    assert stand is not None and stand.travelled == 7.5 and np.array_equal(stand.T_session_camera, moved(2.0))
    assert store.stand_at(2, written.stamp_ns) is None and store.stand_at(None, 5) is None
    store.close()


def test_closures_are_read_by_the_numbers_that_their_names_have() -> None:
    store = Store()
    ours = [replace(CLOSURE, to_ns=CLOSURE.to_ns + k) for k in range(3)]
    for one in ours:
        store.add_closure(one, {})
    numbers = dict(store.closure_numbers())
    assert list(numbers) == [identity_of(one) for one in ours[::-1]]
    asked = [numbers[identity_of(ours[2])], numbers[identity_of(ours[0])]]
    assert [one.to_ns for one in store.closures(asked)] == [ours[2].to_ns, ours[0].to_ns]
    assert list(store.closures([])) == []
    with pytest.raises(StoreError, match="expected a closure of the number 99, got none"):
        list(store.closures([99]))
