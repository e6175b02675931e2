# SPDX-License-Identifier: Apache-2.0
"""Claims: one holder, until it lets go or is killed."""

from __future__ import annotations

import fcntl
import os
import signal
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

from objreg_ros.memory.claim import Claim, StoreError, read_header, unwritten_by_others
from objreg_ros.memory.store import Store

HOLDER = """
import sys, time
from pathlib import Path
from objreg_ros.memory.claim import Claim
claim = Claim(Path(sys.argv[1]), Path.touch)
print("held", flush=True)
time.sleep(60)
"""


def test_a_second_holder_is_refused_until_the_first_lets_go_and_nothing_is_left(tmp_path: Path) -> None:
    place = tmp_path / "place.db"
    first = Claim(place, Path.touch)
    wanted = rf"place\.db: in use by another registrar: .* process {os.getpid()}; end that, or use another path"
    for _ in range(2):
        with pytest.raises(StoreError, match=wanted):
            Claim(place, Path.touch)
    first.release()
    second = Claim(place, Path.touch)
    first.release()  # again: nothing happens
    with pytest.raises(StoreError, match="in use"):
        Claim(place, Path.touch)
    second.release()
    assert [p.name for p in tmp_path.iterdir()] == ["place.db"]


def test_a_store_is_one_by_whatever_name_it_is_called(tmp_path: Path) -> None:
    (tmp_path / "place.db").touch()
    (tmp_path / "other").symlink_to(tmp_path / "place.db")
    (tmp_path / "third").hardlink_to(tmp_path / "place.db")
    first = Claim(tmp_path / "place.db", Path.touch)
    for name in ("other", "third"):
        with pytest.raises(StoreError, match="in use"):
            Claim(tmp_path / name, Path.touch)
    first.release()


def test_the_claim_of_a_killed_process_is_gone_with_it(tmp_path: Path, repository: Path) -> None:
    place = tmp_path / "place.db"
    command = [sys.executable, "-c", HOLDER, str(place)]
    environment = {**os.environ, "PYTHONPATH": str(repository)}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as holder:
        assert holder.stdout is not None and holder.stdout.readline() == "held\n"
        with pytest.raises(StoreError, match=f"process {holder.pid};"):
            Claim(place, Path.touch)
        holder.send_signal(signal.SIGKILL)
    Claim(place, Path.touch).release()


def test_a_lock_upon_a_file_that_another_took_the_place_of_is_no_claim(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place, lock = tmp_path / "place.db", fcntl.flock
    place.write_text("old")
    newer = [tmp_path / "newer"]
    newer[0].write_text("new")

    def late(descriptor: int, how: int) -> None:
        if newer:
            os.replace(newer.pop(), place)  # between the opening and the locking
        lock(descriptor, how)

    monkeypatch.setattr(fcntl, "flock", late)
    claim = Claim(place, Path.touch)
    assert read_header(place) == b"new"
    with pytest.raises(StoreError, match="in use"):
        Claim(place, Path.touch)
    claim.release()


def test_a_file_that_takes_the_place_of_another_is_claimed_as_that_was(tmp_path: Path) -> None:
    place = tmp_path / "place.db"
    claim = Claim(place, Path.touch)
    claim.replace(lambda beside: beside.write_text("new"))
    assert place.read_text() == "new"
    with pytest.raises(StoreError, match="in use"):
        Claim(place, Path.touch)

    def fail(beside: Path) -> None:
        beside.write_text("half")
        raise OSError("the disk is full")

    with pytest.raises(OSError, match="full"):
        claim.replace(fail)
    assert place.read_text() == "new" and [p.name for p in tmp_path.iterdir()] == ["place.db"]
    claim.release()
    Claim(place, Path.touch).release()


def test_readers_and_the_locks_of_the_database_are_not_disturbed(tmp_path: Path, repository: Path) -> None:
    place = tmp_path / "place.db"
    store = sqlite3.connect(place, isolation_level=None)
    store.execute("CREATE TABLE a (b)")
    claim = Claim(place, Path.touch)
    store.execute("BEGIN EXCLUSIVE")
    with pytest.raises(StoreError, match="in use"):  # closes nothing: that would end the lock of the database
        Claim(place, Path.touch)
    assert read_header(place).startswith(b"SQLite")
    command = "import sqlite3, sys; sqlite3.connect(sys.argv[1], timeout=0).execute('SELECT * FROM a')"
    said = subprocess.run([sys.executable, "-c", command, str(place)], capture_output=True, text=True, check=False)
    assert "database is locked" in said.stderr
    store.close()
    claim.release()


def test_a_file_of_another_kind_at_the_name_beside_is_kept(tmp_path: Path) -> None:
    (tmp_path / "place.db.new").write_bytes(b"precious")
    with pytest.raises(StoreError, match=r"place\.db\.new: expected no file, got one of another kind"):
        Claim(tmp_path / "place.db", lambda beside: None)
    assert [path.name for path in tmp_path.iterdir()] == ["place.db.new"]
    assert (tmp_path / "place.db.new").read_bytes() == b"precious"


def test_a_place_that_cannot_be_locked_is_a_store_error(tmp_path: Path) -> None:
    (tmp_path / "place.db.new").mkdir()
    with pytest.raises(StoreError, match=r"place\.db: cannot keep it from other registrars: .*place\.db\.new"):
        Claim(tmp_path / "place.db", Path.touch)


def test_a_holder_that_is_forgotten_lets_go(tmp_path: Path) -> None:
    held = Claim(tmp_path / "place.db", Path.touch)
    del held
    Claim(tmp_path / "place.db", Path.touch).release()


def test_a_file_that_is_only_read_is_kept_from_writers_until_the_end(tmp_path: Path) -> None:
    path = tmp_path / "place.db"
    Store(path).close()
    before = path.read_bytes()
    with unwritten_by_others(path), unwritten_by_others(path), pytest.raises(StoreError, match="in use"):
        Store(path)
    Store(path).close()
    assert path.read_bytes() == before


def test_a_file_that_a_registrar_has_is_not_kept_from_it(tmp_path: Path) -> None:
    store = Store(tmp_path / "place.db")
    with pytest.raises(StoreError, match="in use by a registrar"), unwritten_by_others(tmp_path / "place.db"):
        pass
    store.close()
    with pytest.raises(StoreError, match="a store that can be read"), unwritten_by_others(tmp_path / "none.db"):
        pass
