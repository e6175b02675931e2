# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from registration.samples import keyframe
from report.places import tying

from objreg_ros.data.closures import LoopClosure, ObjectMatch
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store import Store, StoreError
from objreg_tools.merge.sources import First, open_sources


def written(path: Path, robot: str, *moments: tuple[float, int], closures: tuple[LoopClosure, ...] = ()) -> Path:
    """A store of a robot's keyframes at these times in these sessions, each with objects of landmark 7."""
    store = Store(path)
    for seconds, session in moments:
        one = replace(keyframe(store.next_keyframe(), seconds), session=session, robot=robot)
        sightings = [replace(sighting, landmark=7) for sighting in sightings_of(one)]
        store.write_keyframe(one, sightings, closures)
        closures = ()
    store.close()
    return path


def two(folder: Path) -> list[Path]:
    return [written(folder / "a.db", "one", (1, 0), (2, 3)), written(folder / "b.db", "two", (5, 1))]


def test_numbers_of_a_store_come_after_those_of_the_stores_before(tmp_path: Path) -> None:
    with open_sources(two(tmp_path)) as sources:
        assert [source.first for source in sources] == [First(0, 0, 0), First(2, 4, 7)]
        assert [list(source.numbers()) for source in sources] == [[(1, 1), (2, 2)], [(1, 3)]]
        assert [source.sessions for source in sources] == [{0: 0, 3: 3}, {1: 5}]
        one, sightings = sources[1].read(1, 3)
    assert (one.keyframe_id, one.session, one.robot, one.stamp_ns) == (3, 5, "two", 5_000_000_000)
    assert {(sighting.keyframe_id, sighting.session, sighting.landmark) for sighting in sightings} == {(3, 5, 14)}


def test_a_closure_to_a_robot_whose_keyframes_another_store_has_names_that_keyframe(tmp_path: Path) -> None:
    cup = ObjectMatch(label="cup", object_id=7)
    apart = replace(tying(1.0, 5.0, 0, 9, 0.0), from_robot="one", to_robot="two", objects=(cup,))
    lost = replace(apart, to_ns=6_000_000_000)
    here = written(tmp_path / "a.db", "one", (1, 0), closures=(apart, lost))
    paths = [here, written(tmp_path / "b.db", "two", (5, 1))]
    with open_sources(paths) as sources:
        found, unknown = sources.closures(sources[0])
        first = sources[1].first.session
    assert (found.to_robot, found.to_session) == ("two", first + 1)
    assert (unknown.to_robot, unknown.to_session) == ("two", 9) and first > 9
    assert found.objects[0].object_id == 7


def test_nobody_writes_a_store_while_it_is_read(tmp_path: Path) -> None:
    paths = two(tmp_path)
    with open_sources(paths), pytest.raises(StoreError, match="in use by another registrar"):
        Store(paths[0])
    Store(paths[0]).close()


@pytest.mark.parametrize(("name", "why"), [("none.db", "got no file"), ("text.db", "got a file of another kind")])
def test_a_missing_store_and_one_of_another_kind_are_named(name: str, why: str, tmp_path: Path) -> None:
    (tmp_path / "text.db").write_text("no store")
    with pytest.raises(StoreError, match=f"{name}: .*{why}"), open_sources([two(tmp_path)[0], tmp_path / name]):
        pass
