# SPDX-License-Identifier: Apache-2.0
"""Older stores: all that they say is in the new one, and what is not understood is left alone."""

from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing
from itertools import product
from pathlib import Path

import pytest

from objreg_ros.memory import migration as renewal
from objreg_ros.memory.checksum import checksum_of
from objreg_ros.memory.counters import MOST_IDS
from objreg_ros.memory.store import Store
from objreg_ros.memory.store_file import SCHEMA_VERSION, StoreError

DATA = Path(__file__).parent / "data" / "store_v5.db"  # written by the last code of that version
LATER = DATA.with_name("store_v6.db")  # what the last code of version 6 made of it
LAST = DATA.with_name("store_v7.db")  # what the last code of version 7 made of that


def _old(folder: Path, changes: str = "", data: Path = DATA) -> Path:
    path = folder / "place.db"
    shutil.copy(data, path)
    with closing(sqlite3.connect(path)) as connection:
        connection.executescript(changes)
    return path


@pytest.mark.parametrize("data", [DATA, LATER, LAST])
def test_an_older_store_says_all_that_it_said_of_its_one_robot(tmp_path: Path, data: Path) -> None:
    path = _old(tmp_path, data=data)
    for read_only in (True, False, True):
        with closing(Store(path, read_only=read_only)) as opened:
            assert [p.name for p in tmp_path.iterdir() if p.name.endswith(".new")] == []
            assert opened.keyframe_ids() == [1, 3] and (opened.next_keyframe(), opened.next_landmark()) == (5, 51)
            assert opened.keyframe(1).labels == ("cup", "book") and opened.keyframe(3).session == 1
            assert opened.keyframe(3).view.grey.shape == (30, 40)
            assert [opened.keyframe(k).robot for k in (1, 3)] == ["", ""] and opened.origins() == {}
            assert [s.landmark for s in opened.sightings()] == [3, 10, 6, 13]
            assert [(c.to_ns, c.labels, c.evidence) for c in opened.closures()] == [
                (1, ("cup",), {"score": 0.5}),
                (2, ("cup",), {"score": 0.5}),
                (3, ("cup",), {"score": 0.5}),
            ]
            assert opened.vetoes() == []
            assert [(c.robots, c.from_session) for c in opened.closures()] == [(("", ""), None)] * 3
        assert [p.name for p in tmp_path.iterdir()] == ["place.db"]
    assert path.read_bytes()[63] == SCHEMA_VERSION


@pytest.mark.parametrize(
    ("data", "change"),
    [
        (DATA, "UPDATE closure SET to_ns = 9"),
        (LATER, "UPDATE closure SET to_session = 9"),
        (LAST, "UPDATE keyframe SET session = 7"),
        (LAST, "UPDATE scene SET view = x'00'"),
        (LAST, "UPDATE cloud SET points = x'00'"),
        (LAST, "UPDATE closure SET to_session = 9"),
        (LAST, "DELETE FROM closure WHERE id = 1"),
        (LAST, "UPDATE counters SET forgotten = 3"),
        *product(
            (DATA, LATER),
            (
                "UPDATE keyframe SET session = 7",
                "UPDATE object SET cloud = x'00'",
                "DELETE FROM closure WHERE id = 1",
                "UPDATE books SET closure_seals = 0",
            ),
        ),
    ],
)
def test_an_older_store_that_was_changed_is_refused_and_left(tmp_path: Path, data: Path, change: str) -> None:
    path = _old(tmp_path, change, data)
    before = path.read_bytes()
    with pytest.raises(StoreError, match="damaged"):
        Store(path)
    assert path.read_bytes() == before


def test_reading_an_older_store_does_not_renew_it(tmp_path: Path) -> None:
    path = _old(tmp_path)
    Store(path, read_only=True).close()
    assert path.read_bytes() == DATA.read_bytes() and [p.name for p in tmp_path.iterdir()] == ["place.db"]


def test_a_renewal_that_fails_or_is_killed_leaves_the_old_store(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = _old(tmp_path)

    def full(*_: object) -> None:
        raise sqlite3.OperationalError("database or disk is full")

    with monkeypatch.context() as patched:
        patched.setattr(renewal, "sealed", full)
        with pytest.raises(StoreError, match=r"place\.db: cannot open: database or disk is full; it was left as it is"):
            Store(path)
        assert path.read_bytes() == DATA.read_bytes() and [p.name for p in tmp_path.iterdir()] == ["place.db"]
    (tmp_path / "place.db.new").write_bytes(b"SQLite format 3\0" + b"what a killed process left" * 1000)
    (tmp_path / "place.db.new-journal").write_bytes(b"its journal")
    with closing(Store(path)) as opened:
        assert opened.keyframe_ids() == [1, 3]
    assert [p.name for p in tmp_path.iterdir()] == ["place.db"]


def test_an_older_store_whose_log_was_left_is_renewed_with_it(tmp_path: Path) -> None:
    path, killed = _old(tmp_path, "UPDATE keyframe SET session = 4 WHERE id = 3;"), tmp_path / "killed" / "place.db"
    killed.parent.mkdir()
    with closing(sqlite3.connect(path)) as connection:  # what is whole is in the log alone
        connection.executescript("PRAGMA journal_mode = WAL; UPDATE keyframe SET session = 1 WHERE id = 3;")
        for name in ("place.db", "place.db-wal"):
            shutil.copy(tmp_path / name, killed.parent / name)
    for _ in range(2):
        with closing(Store(killed)) as opened:
            assert opened.keyframe(3).session == 1 and opened.next_session() == 2


STRANGE = {
    "DELETE FROM books": "expected one row of counters",
    "UPDATE books SET landmark = 9223372036854775807": "the counters: expected the checksum",
    "UPDATE keyframe SET session = 9223372036854775807": "session: expected less than",
    "UPDATE object SET id = 9223372036854775807 WHERE id = 1": "id: expected less than",
    "UPDATE keyframe SET stamp_ns = 'soon'": "stamp_ns: expected INTEGER, got 'soon'",
    "UPDATE closure SET labels = x'00'": "labels: expected TEXT",
    "CREATE TRIGGER t AFTER INSERT ON keyframe BEGIN DELETE FROM object; END": "trigger t",
    "CREATE VIEW v AS SELECT * FROM keyframe": "view v",
    "ALTER TABLE object ADD COLUMN more": "object more",
    "ALTER TABLE object DROP COLUMN density": "object density",
    "PRAGMA user_version = 0": "expected schema version 5 to 8, got 0; it was left as it is. Use another path",
    "PRAGMA user_version = 4": "expected schema version 5 to 8, got 4; .* with objreg_ros 0.2.0 first",
    "PRAGMA user_version = 6": "expected the tables of a store of version 6",
    "PRAGMA user_version = 7": "expected the tables of a store of version 7",
    "PRAGMA user_version = 8": "one that no store has|another or none",
}


@pytest.mark.parametrize("change", STRANGE)
def test_an_older_store_that_no_registrar_wrote_is_one_line_and_left_untouched(tmp_path: Path, change: str) -> None:
    path = _old(tmp_path, change)
    before = path.read_bytes()
    for read_only in (True, False):
        with pytest.raises(StoreError, match=rf"^[^\n]*place\.db: [^\n]*(?:{STRANGE[change]})[^\n]*$"):
            Store(path, read_only=read_only)
    assert path.read_bytes() == before and [p.name for p in tmp_path.iterdir()] == ["place.db"]


def test_an_older_store_whose_ids_are_used_up_is_refused_and_left(tmp_path: Path) -> None:
    path = _old(tmp_path)
    with closing(sqlite3.connect(path)) as connection:
        connection.row_factory = sqlite3.Row
        row = {**connection.execute("SELECT * FROM books").fetchone(), "landmark": MOST_IDS["landmark"]}
        changed = (row["landmark"], checksum_of("books", row, "seal"))
        with connection as transaction:
            transaction.execute("UPDATE books SET landmark = ?, seal = ?", changed)
    before = path.read_bytes()
    with pytest.raises(StoreError, match=r"place\.db: .* they are used up"):
        Store(path)
    assert path.read_bytes() == before
