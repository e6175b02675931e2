# SPDX-License-Identifier: Apache-2.0
"""Claims: one holder, until it lets go or is killed."""

from __future__ import annotations

import fcntl
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from objreg_ros.registrar.claim import Claim
from objreg_ros.registrar.store_file import StoreError

HOLDER = """
import sys, time
from pathlib import Path
from objreg_ros.registrar.claim import Claim
claim = Claim(Path(sys.argv[1]))
print("held", flush=True)
time.sleep(60)
"""


def test_a_second_holder_is_refused_until_the_first_lets_go_and_nothing_is_left(tmp_path: Path) -> None:
    place = tmp_path / "place.db"
    first = Claim(place)
    wanted = rf"place\.db: in use by another registrar: .* process {os.getpid()}; end that, or use another path"
    for _ in range(2):
        with pytest.raises(StoreError, match=wanted):
            Claim(place)
    first.release()
    second = Claim(place)
    first.release()  # again: nothing happens
    with pytest.raises(StoreError, match="in use"):
        Claim(place)
    second.release()
    assert not list(tmp_path.iterdir())


def test_a_store_is_one_by_whatever_name_it_is_called(tmp_path: Path) -> None:
    (tmp_path / "place.db").touch()
    (tmp_path / "other").symlink_to(tmp_path / "place.db")
    first = Claim(tmp_path / "place.db")
    with pytest.raises(StoreError, match="in use"):
        Claim(tmp_path / "other")
    first.release()


def test_the_claim_of_a_killed_process_is_gone_with_it(tmp_path: Path, repository: Path) -> None:
    place = tmp_path / "place.db"
    command = [sys.executable, "-c", HOLDER, str(place)]
    environment = {**os.environ, "PYTHONPATH": str(repository)}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as holder:
        assert holder.stdout is not None and holder.stdout.readline() == "held\n"
        with pytest.raises(StoreError, match=f"process {holder.pid};"):
            Claim(place)
        holder.send_signal(signal.SIGKILL)
    Claim(place).release()


def test_a_lock_upon_a_file_that_its_holder_took_away_is_no_claim(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place, lock, first = tmp_path / "place.db", fcntl.flock, [Claim(tmp_path / "place.db")]

    def late(descriptor: int, how: int) -> None:
        if first:
            first.pop().release()  # between the opening and the locking of another one
        lock(descriptor, how)

    monkeypatch.setattr(fcntl, "flock", late)
    claim = Claim(place)
    with pytest.raises(StoreError, match="in use"):
        Claim(place)
    claim.release()


def test_a_place_that_cannot_be_locked_is_a_store_error(tmp_path: Path) -> None:
    (tmp_path / "place.db.lock").mkdir()
    with pytest.raises(StoreError, match=r"place\.db: cannot keep it from other registrars by .*place\.db\.lock"):
        Claim(tmp_path / "place.db")


def test_a_holder_that_is_forgotten_lets_go(tmp_path: Path) -> None:
    held = Claim(tmp_path / "place.db")
    del held
    Claim(tmp_path / "place.db").release()
