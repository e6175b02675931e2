# SPDX-License-Identifier: Apache-2.0
"""The file of a store: what is older is renewed, what is foreign, newer or damaged is left alone."""

from __future__ import annotations

import shutil
import sqlite3
from pathlib import Path

import numpy as np
import pytest

from objreg_ros.data import LoopClosure
from objreg_ros.registrar.plumb import DOUBT, ONE_VIEW
from objreg_ros.registrar.sighting import sightings_of
from objreg_ros.registrar.store import Store
from objreg_ros.registrar.store_file import SCHEMA_VERSION, StoreError

from .samples import keyframe, moved


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


def test_a_place_where_no_store_can_be_made_is_a_store_error(tmp_path: Path) -> None:
    for path in (tmp_path / "nowhere" / "place.db", tmp_path):
        with pytest.raises(StoreError, match="expected a file in an existing folder"):
            Store(path)
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
    for number in range(1, 5):
        written = keyframe(number, float(number))
        store.add(written, sightings_of(written))
    store.close()
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2] if damage == "cut" else whole[:4096] + b"\x77" * 8192 + whole[12288:])
    _refused(path, "intact store")
