# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest

from objreg_ros.memory.store import Store
from objreg_tools.merge.unfinished import Progress, Unfinished, added

INPUTS = [{"path": "/a.db", "bytes": 1}, {"path": "/b.db", "bytes": 2}]


def begun(folder: Path) -> Unfinished:
    """A merge whose first leg, of two closures, is written, and whose second was being written."""
    unfinished = Unfinished(folder / "c.db", INPUTS, {"labels": ("cup",)})
    Store(unfinished.store_path).close()
    unfinished.begin_leg({"kept": 2}, 3)
    unfinished.end_leg()
    unfinished.begin_leg({"closures": 4}, 7)
    return unfinished


@pytest.mark.parametrize(("next_closure", "legs", "counts"), [(3, 1, {"kept": 2}), (7, 2, {"kept": 2, "closures": 4})])
def test_the_store_says_whether_the_last_leg_was_written(
    next_closure: int, legs: int, counts: dict[str, int], tmp_path: Path
) -> None:
    begun(tmp_path)
    again = Unfinished(tmp_path / "c.db", INPUTS, {"labels": ("cup",)})
    again.progress.settle(next_closure)
    assert again.goes_on and (again.progress.legs, again.progress.counts) == (legs, counts)


def test_what_is_settled_is_settled_once() -> None:
    progress = Progress(next_closure=3, pending={"kept": 2})
    progress.settle(3)
    progress.settle(3)
    assert (progress.legs, progress.counts) == (1, {"kept": 2})


def test_a_merge_of_other_stores_or_by_other_parameters_does_not_go_on(tmp_path: Path) -> None:
    begun(tmp_path)
    with pytest.raises(ValueError, match=r"of the same inputs, got one of others: /a\.db, /b\.db; delete .*unfinished"):
        Unfinished(tmp_path / "c.db", INPUTS[:1], {"labels": ("cup",)})
    with pytest.raises(ValueError, match="of the same params"):
        Unfinished(tmp_path / "c.db", INPUTS, {"labels": ()})


def test_a_store_whose_progress_is_lost_does_not_go_on(tmp_path: Path) -> None:
    begun(tmp_path)
    (tmp_path / "c.db.unfinished.json").write_text("{")
    with pytest.raises(ValueError, match="expected how far the merge came"):
        Unfinished(tmp_path / "c.db", INPUTS, {})


def test_what_is_complete_has_the_name_and_nothing_is_left_beside_it(tmp_path: Path) -> None:
    unfinished = begun(tmp_path)
    unfinished.finish(Store(unfinished.store_path))
    assert [path.name for path in tmp_path.iterdir()] == ["c.db"]
    with pytest.raises(ValueError, match="expected a new file"):
        Unfinished(tmp_path / "c.db", INPUTS, {})


def test_counts_add_up_by_name() -> None:
    assert added({"a": 1, "b": 2}, {"b": 3, "c": 4}) == {"a": 1, "b": 5, "c": 4}
