# SPDX-License-Identifier: Apache-2.0
"""The counters: what is missing is noticed, and ids end."""

from __future__ import annotations

import sqlite3

import pytest

from objreg_ros.memory.counters import MOST_IDS, Counters, read_counters
from objreg_ros.memory.store_file import bear


def _store() -> sqlite3.Connection:
    connection = sqlite3.connect(":memory:")
    connection.row_factory = sqlite3.Row
    bear(connection)
    return connection


def test_counters_come_back_as_they_were_written() -> None:
    connection, counters = _store(), Counters(keyframe=7, landmark=9, forgotten=3)
    counters.write(connection)
    assert read_counters(connection) == counters and counters.next("landmark") == 10


def test_counters_that_do_not_agree_with_the_rows_are_refused() -> None:
    connection, counters = _store(), Counters()
    counters.enter("closure", 4)
    counters.write(connection)
    with pytest.raises(ValueError, match="expected 1 closures, got 0"):
        read_counters(connection)


def test_counters_that_were_changed_are_refused() -> None:
    connection = _store()
    connection.execute("UPDATE counters SET landmark = 5")
    with pytest.raises(ValueError, match=r"the counters: expected the checksum .* damaged"):
        read_counters(connection)


@pytest.mark.parametrize("what", MOST_IDS)
def test_ids_end(what: str) -> None:
    counters = Counters(**{what: MOST_IDS[what]})
    with pytest.raises(ValueError, match=f"expected ids of {what}s up to .* used up"):
        counters.next(what)


def test_a_landmark_with_an_id_that_no_message_holds_is_not_counted() -> None:
    counters = Counters()
    counters.give_landmark(MOST_IDS["landmark"])
    with pytest.raises(ValueError, match="expected ids of landmarks up to 4294967294, got 4294967295"):
        counters.give_landmark(MOST_IDS["landmark"] + 1)
    assert counters.landmark == MOST_IDS["landmark"]
