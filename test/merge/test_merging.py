# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from merge.stores import AWAY, BESIDE, HERE, PARAMS, store, two_stores
from objreg_ros.data.closure_id import closure_id
from objreg_ros.data.closures import LoopClosure
from objreg_ros.geometry import inverse, pose_error
from objreg_ros.memory.codec import scene_row
from objreg_ros.memory.store import Store, StoreError
from objreg_ros.memory.veto import Veto
from objreg_ros.registrar.registrar import Registrar
from objreg_tools.merge.merging import Merged, merge
from objreg_tools.merge.ties import Tying


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("merged")


@pytest.fixture(scope="module")
def merged(folder: Path) -> Merged:
    return merge(two_stores(folder), folder / "both.db", PARAMS)


def closures(path: Path) -> list[LoopClosure]:
    opened = Store(path, read_only=True)
    try:
        return list(opened.closures())
    finally:
        opened.close()


def test_all_keyframes_are_there_as_they_were_under_new_numbers(merged: Merged, folder: Path) -> None:
    both, west = Store(merged.path, read_only=True), Store(folder / "west.db", read_only=True)
    assert both.keyframe_ids() == [1, 2, 3, 4]
    one, other = both.keyframe(3), west.keyframe(1)
    assert (one.stamp_ns, one.session, one.robot, one.frame_id) == (other.stamp_ns, 1, "west", "west/camera")
    assert {**scene_row(one), "id": 0, "checksum": 0} == {**scene_row(other), "id": 0, "checksum": 0}
    assert all((a.cloud.xyz == b.cloud.xyz).all() for a, b in zip(one.objects, other.objects, strict=True))
    both.close()
    west.close()


def test_closures_between_stores_have_the_true_pose_and_name_both_robots(merged: Merged) -> None:
    between = [one for one in closures(merged.path) if one.from_session != one.to_session]
    first = next(one for one in between if (one.from_ns, one.to_ns) == (0, 30_000_000_000))
    rotation, distance = pose_error(first.T_from_to, inverse(HERE) @ BESIDE)
    assert rotation < 1.0 and distance < 2.0
    assert first.robots == ("east", "west") and (first.from_session, first.to_session) == (0, 1)
    assert merged.counts["closures"] == len(between) and merged.counts["searched"] == 2


def test_what_was_withdrawn_in_a_store_stays_so_and_comes_back_with_undo(tmp_path: Path) -> None:
    paths = two_stores(tmp_path)
    (gone, *_) = closures(paths[1])
    registrar = Registrar(PARAMS.replaced(store=str(paths[1])))
    registrar.veto([closure_id(gone)])
    registrar.close()
    both = merge(paths, tmp_path / "both.db", PARAMS).path
    ends = lambda one: (one.from_ns, one.to_ns)  # noqa: E731
    assert ends(gone) not in map(ends, closures(both))
    registrar = Registrar(PARAMS.replaced(store=str(both)))
    (vetoed,) = registrar.vetoed
    assert ends(vetoed) == ends(gone) and vetoed.from_session == 1
    (again,) = registrar.undo_veto([closure_id(vetoed)]).closures
    registrar.close()
    assert ends(again) == ends(gone) and ends(again) in map(ends, closures(both))


@pytest.mark.parametrize("by_both", [False, True])
def test_what_one_store_withdrew_of_a_pair_that_two_have_holds_in_neither(by_both: bool, tmp_path: Path) -> None:
    paths = two_stores(tmp_path, robots=("a", "b"))
    known = {"T_from_to": np.eye(4), "covariance": np.eye(6), "labels": ("cup",)}
    a, b = ({f"{end}_robot": "a", f"{end}_ns": 0, f"{end}_session": of} for end, of in (("from", 0), ("to", 1)))
    a |= {"to_robot": "b", "to_ns": 30_000_000_000, "to_session": 1}
    b |= {"from_robot": "b", "from_ns": 30_000_000_000, "from_session": 0}
    same = a | {"from_session": 1, "to_session": 0}  # what b withdrew, as a has it
    for path, of, gone in ((paths[0], a, True), (paths[1], same if by_both else b, by_both)):
        store = Store(path)
        store.add_closure(LoopClosure(**known, **of), {})
        if gone:
            store.veto([Veto(closure=LoopClosure(**known, **of))])
        store.close()
    both = merge(paths, tmp_path / "both.db", PARAMS).path
    pair = {0, 30_000_000_000}
    assert pair not in [{one.from_ns, one.to_ns} for one in closures(both)]
    registrar = Registrar(PARAMS.replaced(store=str(both)))
    ids = [closure_id(one) for one in registrar.vetoed]
    assert len(registrar.undo_veto(ids).closures) == len(ids) == registrar.counts()["vetoed"] + (1 if by_both else 2)
    registrar.close()
    assert [{one.from_ns, one.to_ns} for one in closures(both)].count(pair) == len(ids)


def test_closures_of_each_store_are_kept(merged: Merged, folder: Path) -> None:
    before = [(one.from_ns, one.to_ns) for name in ("east", "west") for one in closures(folder / f"{name}.db")]
    own = [(one.from_ns, one.to_ns) for one in closures(merged.path) if one.from_session == one.to_session]
    assert before and own == before


def test_an_object_that_two_stores_know_is_one(merged: Merged, folder: Path) -> None:
    opened = Store(merged.path, read_only=True)
    cups = {one.landmark for one in opened.sightings() if one.label == "cup"}
    turns = {one.session: one.R_landmark_session for one in opened.sightings() if one.label == "cup"}
    opened.close()
    assert len(cups) == 1
    R_east_west = inverse(HERE)[:3, :3] @ BESIDE[:3, :3]  # the axes of each session are those of its first camera
    assert np.degrees(np.arccos((np.trace(turns[1].T @ R_east_west) - 1) / 2)) < 1.0


def test_stores_are_not_changed(folder: Path, tmp_path: Path) -> None:
    paths = two_stores(tmp_path)
    before = [path.read_bytes() for path in paths]
    merge(paths, tmp_path / "both.db", PARAMS)
    assert [path.read_bytes() for path in paths] == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["both.db", "east.db", "west.db"]


def test_a_registrar_goes_on_with_a_merged_store(tmp_path: Path) -> None:
    merge(two_stores(tmp_path), tmp_path / "both.db", PARAMS)
    registrar = Registrar(PARAMS.replaced(store=str(tmp_path / "both.db")))
    assert registrar.counts()["keyframes"] == 4 and registrar.take_session() == 2
    registrar.close()


class Stopped(BaseException):
    """What Ctrl-C raises, at a chosen moment."""


@pytest.mark.parametrize("after", [1, 3, 4, 5])
def test_what_was_interrupted_goes_on_and_comes_to_the_same(after: int, tmp_path: Path, merged: Merged) -> None:
    paths, place = two_stores(tmp_path), tmp_path / "both.db"

    def stop(done: int, _: int) -> None:
        if done == after:
            raise Stopped

    with pytest.raises(Stopped):
        merge(paths, place, PARAMS, stop)
    assert not place.exists() and (tmp_path / "both.db.unfinished").exists()
    done = list[tuple[int, int]]()
    again = merge(paths, place, PARAMS, lambda *at: done.append(at))
    assert again.counts == merged.counts and done[-1] == (6, 6)
    assert list(map(str, closures(place))) == list(map(str, closures(merged.path)))


@pytest.mark.parametrize("written", [False, True])
def test_a_leg_that_was_being_written_is_neither_lost_nor_written_twice(
    written: bool, tmp_path: Path, merged: Merged, monkeypatch: pytest.MonkeyPatch
) -> None:
    paths, place, write = two_stores(tmp_path), tmp_path / "both.db", Tying.write

    def stop(tying: Tying) -> int:
        if written:
            write(tying)
        raise Stopped

    with monkeypatch.context() as patched, pytest.raises(Stopped):
        patched.setattr(Tying, "write", stop)
        merge(paths, place, PARAMS)
    again = merge(paths, place, PARAMS)
    assert again.counts == merged.counts
    assert list(map(str, closures(place))) == list(map(str, closures(merged.path)))


def test_a_full_disk_is_named_and_leaves_what_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    paths, place = two_stores(tmp_path), tmp_path / "both.db"

    def full(*_: object) -> None:
        raise StoreError(f"{place}.unfinished: cannot write keyframe 1: database or disk is full")

    with monkeypatch.context() as patched, pytest.raises(StoreError, match="disk is full"):
        patched.setattr(Store, "write_keyframe", full)
        merge(paths, place, PARAMS)
    assert merge(paths, place, PARAMS).counts["closures"] == 4 and place.exists()


def test_a_damaged_keyframe_is_left_out_and_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    paths = two_stores(tmp_path)
    import sqlite3

    with sqlite3.connect(paths[0]) as connection:
        connection.execute("UPDATE scene SET context = x'00' WHERE id = 2")
    connection.close()
    found = merge(paths, tmp_path / "both.db", PARAMS)
    assert len(found.damaged) == 1 and "east.db: cannot read keyframe 2" in found.damaged[0]
    opened = Store(found.path, read_only=True)
    assert opened.keyframe_ids() == [1, 3, 4]
    opened.close()


def test_other_places_are_not_tied(tmp_path: Path) -> None:
    paths = [store(tmp_path / "a.db", (0, HERE)), store(tmp_path / "b.db", (30, AWAY))]
    found = merge(paths, tmp_path / "both.db", PARAMS)
    assert found.counts["searched"] == 1 and all(
        pose_error(one.T_from_to, inverse(HERE) @ AWAY)[1] < 5.0 for one in closures(found.path)
    )
