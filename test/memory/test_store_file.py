# SPDX-License-Identifier: Apache-2.0
"""The file of a store: what is foreign, newer or damaged is left alone."""

from __future__ import annotations

import os
import shutil
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest
from registration.samples import keyframe

from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store import Store
from objreg_ros.memory.store_file import SCHEMA_VERSION, StoreError

DATA = Path(__file__).parent / "data" / "store_v5.db"  # of the release before
CHILD = """
import resource, sys
from objreg_ros.memory.store import Store
resource.setrlimit(resource.RLIMIT_FSIZE, (8192, 8192))
import signal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
try:
    Store(sys.argv[1])
except OSError as error:
    print(type(error).__name__, error)
"""


@pytest.mark.parametrize("old", [False, True])
def test_a_full_disk_leaves_nothing_half_made(tmp_path: Path, repository: Path, old: bool) -> None:
    path = Path(shutil.copy(DATA, tmp_path / "place.db")) if old else tmp_path / "place.db"
    environment = {**os.environ, "PYTHONPATH": str(repository)}
    said = subprocess.run(
        [sys.executable, "-c", CHILD, str(path)], env=environment, capture_output=True, text=True, check=True
    )
    assert said.stdout.startswith(f"StoreError {path}: cannot open: ") and len(said.stdout.splitlines()) == 1
    assert [p.name for p in tmp_path.iterdir()] == ([path.name] if old else [])
    assert not old or path.read_bytes() == DATA.read_bytes()


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
        store.write_keyframe(written, sightings_of(written))
    store.close()
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2] if damage == "cut" else whole[:4096] + b"\x77" * 8192 + whole[12288:])
    _refused(path, "intact store")
