# SPDX-License-Identifier: Apache-2.0
"""The store: what is written is there, what is foreign is left alone, kill -9 takes nothing acknowledged."""

from __future__ import annotations

import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from objreg_ros.data import LoopClosure
from objreg_ros.registrar import store as store_module
from objreg_ros.registrar.plumb import DOUBT, ONE_VIEW
from objreg_ros.registrar.sighting import sightings_of
from objreg_ros.registrar.store import SCHEMA_VERSION, Store, StoreError

from .samples import box, keyframe, moved

WRITER = """
import sys
from objreg_ros.registrar.sighting import sightings_of
from objreg_ros.registrar.store import Store
from samples import keyframe
store = Store(sys.argv[1])
while True:
    number = store.next_keyframe()
    written = keyframe(number, float(number))
    store.add(written, sightings_of(written))
    print(number, flush=True)
"""


def _add(store: Store, seconds: float = 0.0, **kwargs: object) -> int:
    written = keyframe(store.next_keyframe(), seconds, **kwargs)
    store.add(written, sightings_of(written))
    return written.keyframe_id


def test_a_keyframe_comes_back_as_it_went_in(tmp_path: Path) -> None:
    with_pose = keyframe(1, 3.5, objects=(box("cup", (0, 0, 1)), box("book", (0.3, 0, 1), instance=2)))
    store = Store(tmp_path / "place.db")
    store.add(with_pose, sightings_of(with_pose))
    store.close()
    back = Store(tmp_path / "place.db").keyframe(1)
    assert (back.stamp_ns, back.session, back.labels, back.frame_id) == (3_500_000_000, 0, ("cup", "book"), "camera")
    assert np.array_equal(back.objects[1].cloud.xyz, with_pose.objects[1].cloud.xyz)
    assert np.array_equal(back.objects[1].cloud.rgb, with_pose.objects[1].cloud.rgb)
    assert np.array_equal(back.context.xyz, with_pose.context.xyz)
    assert np.array_equal(back.view.grey, with_pose.view.grey)
    assert np.allclose(back.view.xyz, with_pose.view.xyz, atol=1e-5)
    assert np.array_equal(back.T_odom_camera, np.eye(4)) and np.array_equal(back.gravity, (0, 1, 0))


def test_a_store_in_memory_needs_no_file() -> None:
    store = Store()
    number = _add(store)
    assert store.keyframe(number).labels == ("cup",) and store.counts()["objects"] == 1


def test_sightings_come_back_with_landmark_position_and_descriptor(tmp_path: Path) -> None:
    store = Store(tmp_path / "place.db")
    written = replace(
        keyframe(1, objects=(box("cup", (0.2, 0, 1)),), T_odom_camera=moved(1.0)), travelled=0.5, turned=7.0
    )
    (sighting,) = sightings_of(written)
    store.add(written, [sighting.of_landmark(7, np.eye(3))])
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


def test_merged_landmarks_are_written(tmp_path: Path) -> None:
    store = Store()
    written = keyframe(1)
    store.add(written, [sightings_of(written)[0].of_landmark(9, np.eye(3))])
    later = keyframe(2, 5.0)
    store.add(later, [sightings_of(later)[0].of_landmark(2, np.eye(3))], merged={9: 2})
    assert [sighting.landmark for sighting in store.sightings()] == [2, 2]


def test_a_closure_comes_back_with_its_covariance(tmp_path: Path) -> None:
    store = Store(tmp_path / "place.db")
    closure = LoopClosure(
        from_ns=1, to_ns=2, T_from_to=moved(0.3), covariance=0.01 * np.eye(6), labels=("cup",), evidence={"score": 0.5}
    )
    written = keyframe(1)
    store.add(written, sightings_of(written), [closure])
    store.close()
    (back,) = Store(tmp_path / "place.db").closures()
    assert np.array_equal(back.T_from_to, closure.T_from_to) and np.array_equal(back.covariance, closure.covariance)
    assert (back.labels, back.evidence) == (("cup",), {"score": 0.5})


def test_a_store_of_the_first_version_is_read_as_it_is_and_renewed_when_it_is_written(tmp_path: Path) -> None:
    path = tmp_path / "place.db"
    store = Store(path)
    closure = LoopClosure(from_ns=1, to_ns=2, T_from_to=moved(0.3), covariance=np.eye(6), labels=("cup",))
    written = keyframe(1)
    store.add(written, sightings_of(written), [closure])
    store._connection.executescript(
        "ALTER TABLE closure DROP COLUMN from_frame_id;"
        "ALTER TABLE closure RENAME COLUMN to_frame_id TO frame_id; DROP TABLE highest; PRAGMA user_version = 1;"
    )
    store.close()
    for read_only in (True, False, True):
        opened = Store(path, read_only=read_only)
        (back,) = opened.closures()
        assert (back.from_frame_id, back.to_frame_id, opened.keyframe(1).labels) == ("camera", "camera", ("cup",))
        opened.close()
    with sqlite3.connect(path) as connection:
        assert connection.execute("PRAGMA user_version").fetchone() == (SCHEMA_VERSION,)


def test_gravity_of_the_second_version_is_that_of_one_view(tmp_path: Path) -> None:
    path, written = tmp_path / "place.db", keyframe(1)
    store = Store(path)
    store.add(written, sightings_of(written))
    store._connection.executescript("DROP TABLE highest; PRAGMA user_version = 2;")
    store.close()
    for _ in range(2):  # once and for all
        opened = Store(path)
        assert opened.keyframe(1).gravity_confidence == pytest.approx(ONE_VIEW * written.gravity_confidence**DOUBT)
        opened.close()


def test_landmarks_of_the_third_version_keep_their_ids(tmp_path: Path) -> None:
    path, written = tmp_path / "place.db", keyframe(1)
    store = Store(path)
    store.add(written, [sightings_of(written)[0].of_landmark(7, np.eye(3))])
    store._connection.executescript("DROP TABLE highest; PRAGMA user_version = 3;")
    store.close()
    assert Store(path).next_landmark() == 8


def test_the_id_of_a_landmark_is_never_used_again(tmp_path: Path) -> None:
    path, written = tmp_path / "place.db", keyframe(1)
    store = Store(path)
    assert store.next_landmark() == 1
    store.add(written, [sightings_of(written)[0].of_landmark(7, np.eye(3))])
    store.remove([1])
    store.close()
    opened = Store(path)
    opened.clear()
    assert opened.next_landmark() == 8


def test_a_place_where_no_store_can_be_made_is_a_store_error(tmp_path: Path) -> None:
    for path in (tmp_path / "nowhere" / "place.db", tmp_path):
        with pytest.raises(StoreError, match="expected a file in a folder"):
            Store(path)
    assert not list(tmp_path.iterdir())


def test_what_the_database_refuses_later_is_a_store_error_too(tmp_path: Path) -> None:
    store = Store(tmp_path / "place.db")
    number = _add(store)
    store.close()
    for refused in (store.clear, store.counts, store.next_keyframe, lambda: store.remove([number])):
        with pytest.raises(StoreError, match=r"place\.db: cannot"):
            refused()


def test_what_cannot_be_written_is_a_store_error_and_leaves_the_store_as_it_was() -> None:
    store = Store()
    number = _add(store)
    twice = keyframe(number)
    with pytest.raises(StoreError, match="cannot write keyframe 1"):
        store.add(twice, sightings_of(twice))
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
        store.add(written, [sightings_of(written)[0].of_landmark(landmark, np.eye(3))])
    assert (store.counts()["objects"], store.counts()["landmarks"]) == (3, 2)


def test_the_last_session_that_reached_a_moment_is_one_before_and_may_end_with_it() -> None:
    store = Store()
    for session, seconds in ((0, 30.0), (1, 20.0), (2, 40.0)):
        _add(store, seconds, session=session)
    reached = {
        s: [store.last_session_beyond(k, round(s * 1e9)) for k in (0, 1, 2, 3)] for s in (15, 20, 25, 30, 35, 45)
    }
    assert reached == {
        15: [-1, 0, 1, 2],
        20: [-1, 0, 1, 2],
        25: [-1, 0, 0, 2],
        30: [-1, 0, 0, 2],
        35: [-1, -1, -1, 2],
        45: [-1, -1, -1, -1],
    }


def test_clearing_forgets_all_but_the_ids() -> None:
    store = Store()
    _add(store)
    store.clear()
    assert set(store.counts().values()) == {0} and store.next_keyframe() == 2


def test_a_copy_can_be_saved_from_memory(tmp_path: Path) -> None:
    store = Store()
    _add(store)
    store.save(tmp_path / "copy.db")
    assert Store(tmp_path / "copy.db").counts()["keyframes"] == 1


def test_a_store_that_was_saved_is_whole_without_the_log_beside_it(tmp_path: Path) -> None:
    store = Store(tmp_path / "place.db")
    _add(store)
    assert store.save() == str(tmp_path / "place.db")
    shutil.copy(tmp_path / "place.db", tmp_path / "alone.db")
    assert Store(tmp_path / "alone.db").counts()["keyframes"] == 1


def test_what_was_not_used_for_longest_leaves_the_memory_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store_module, "CACHED", 2)
    store = Store()
    first, second = (_add(store, float(i)) for i in range(2))
    left, kept = store.keyframe(second), store.keyframe(first)
    _add(store, 2.0)
    assert store.keyframe(first) is kept and store.keyframe(second) is not left


def test_only_the_last_few_keyframes_stay_in_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store_module, "CACHED", 3)
    store = Store()
    numbers = [_add(store, float(i)) for i in range(6)]
    for number in numbers:
        assert store.keyframe(number).keyframe_id == number
    assert len(store._cache) == 3


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


def test_a_missing_store_is_not_made_by_reading(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="got no file"):
        Store(tmp_path / "nothing.db", read_only=True)
    assert not list(tmp_path.iterdir())


def _refused(path: Path, match: str) -> None:
    before = path.read_bytes()
    with pytest.raises(StoreError, match=match):
        Store(path)
    assert path.read_bytes() == before
    assert [p.name for p in path.parent.iterdir()] == [path.name]


def test_a_newer_file_is_refused_and_left_untouched(tmp_path: Path) -> None:
    path = tmp_path / "place.db"
    Store(path).close()
    with sqlite3.connect(path) as connection:
        connection.execute("PRAGMA user_version = 99")
    connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    connection.close()
    _refused(path, f"version {SCHEMA_VERSION} or older, got 99")


def test_a_store_is_newer_where_only_the_log_beside_it_says_so(tmp_path: Path) -> None:
    path = tmp_path / "place.db"
    Store(path).close()
    with sqlite3.connect(path) as connection:
        connection.execute("PRAGMA user_version = 99")
    killed = tmp_path / "killed"
    killed.mkdir()
    for name in (path.name, f"{path.name}-wal"):
        shutil.copy(tmp_path / name, killed / name)
    connection.close()
    assert (killed / path.name).read_bytes()[60:64] == SCHEMA_VERSION.to_bytes(4, "big")
    before = [(killed / name).read_bytes() for name in (path.name, f"{path.name}-wal")]
    with pytest.raises(StoreError, match=f"version {SCHEMA_VERSION} or older, got 99"):
        Store(killed / path.name)
    assert [(killed / name).read_bytes() for name in (path.name, f"{path.name}-wal")] == before


def test_a_file_of_another_kind_is_refused_and_left_untouched(tmp_path: Path) -> None:
    path = tmp_path / "notes.txt"
    path.write_text("nothing like a store\n" * 20)
    _refused(path, "another kind")


def test_another_database_is_refused_and_left_untouched(tmp_path: Path) -> None:
    path = tmp_path / "other.db"
    connection = sqlite3.connect(path)
    connection.execute("CREATE TABLE a (b)")
    connection.close()
    _refused(path, "another SQLite database")


@pytest.mark.parametrize("damage", ["cut", "scribble"])
def test_a_damaged_file_is_refused_and_left_untouched(tmp_path: Path, damage: str) -> None:
    path = tmp_path / "place.db"
    store = Store(path)
    for i in range(4):
        _add(store, float(i))
    store.close()
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2] if damage == "cut" else whole[:4096] + b"\x77" * 8192 + whole[12288:])
    _refused(path, "intact store")


def test_a_damaged_blob_is_reported_when_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "place.db"
    store = Store(path)
    number = _add(store)
    store._connection.execute("UPDATE keyframe SET context = x'00ff00'")
    store._cache.clear()
    with pytest.raises(StoreError, match=r"keyframe 1: .*damaged"):
        store.keyframe(number)


def test_two_processes_killed_at_any_moment_lose_nothing_acknowledged(tmp_path: Path, repository: Path) -> None:
    path, draw = tmp_path / "place.db", random.Random(5)
    places = (repository, repository / "test" / "registrar")
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
