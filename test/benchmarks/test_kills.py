# SPDX-License-Identifier: Apache-2.0
"""The judge of the kills sees a keyframe that was lost, and a store that does not open."""

from __future__ import annotations

import importlib
from contextlib import closing
from pathlib import Path
from typing import Any, Self

import pytest
from registration.samples import keyframe

from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store import Store


class Registrar:
    """Stands in for processes, and for the one that is killed."""

    def __init__(self, *_: Any) -> None: ...
    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None: ...
    def start(self, *_: Any) -> Self:
        return self

    def poll(self) -> None: ...
    def kill(self) -> None: ...
    def wait(self) -> None: ...


class Robot:
    """Receives two keyframes announced."""

    def __init__(self) -> None:
        self.announced: set[int] = set()

    def go_on(self) -> None:
        self.announced |= {1_000_000_000, 2_000_000_000}


@pytest.fixture
def kills(monkeypatch: pytest.MonkeyPatch) -> Any:
    script = importlib.import_module("kills")
    monkeypatch.setattr(script, "Processes", Registrar)
    return script


@pytest.mark.parametrize(("stored", "lost"), [((1.0, 2.0), 0), ((1.0,), 1)])
def test_a_keyframe_that_was_announced_and_is_not_stored_is_lost(
    kills: Any, tmp_path: Path, stored: tuple[float, ...], lost: int
) -> None:
    with closing(Store(tmp_path / "place.db")) as store:
        for number, seconds in enumerate(stored, start=1):
            written = keyframe(number, seconds)
            store.write_keyframe(written, sightings_of(written))
    count = kills.Count()
    kills.kill_once(Robot(), tmp_path, tmp_path / "place.db", 0.0, count)
    assert (count.kills, count.announced, count.lost, count.unreadable) == (1, 2, lost, [])


def test_a_store_that_does_not_open_is_named(kills: Any, tmp_path: Path) -> None:
    (tmp_path / "place.db").write_bytes(b"none")
    count = kills.Count()
    kills.kill_once(Robot(), tmp_path, tmp_path / "place.db", 0.0, count)
    assert len(count.unreadable) == 1 and "place.db" in count.unreadable[0]
