# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from copy import deepcopy
from pathlib import Path
from typing import Any

from objreg_tools.report.batch.batch_comparison import Change, change, ordered, other_result, settings_of
from objreg_tools.report.batch.batch_rows import Row

S = 1_000_000_000


def result(*ends: tuple[int, int], false: int = 0, **made: Any) -> dict[str, Any]:
    """The JSON of a recording with constraints between these seconds."""
    return {
        "recording": "/r/a",
        **dict.fromkeys(("frames", "detections", "objects"), 9),
        "constraints": [{"from_ns": a * S, "to_ns": b * S} for a, b in ends],
        "rejected": {},
        "stage_ms": {},
        "findings": [],
        "truth": {"count": len(ends), "strict": 0, "loose": 0, "false": false},
        "batch": {"made": made, "seconds": 1.0, "notes": []},
    }


def against(now: dict[str, Any], before: dict[str, Any] | None) -> Change:
    return change(Row.of(Path("/r/a"), "a.json", now), now, before)


def test_constraints_of_the_same_stamps_are_kept_and_others_gained_or_lost() -> None:
    one = against(result((0, 50), (0, 90)), result((0, 50), (0, 70), (9, 70)))
    assert (one.kept, one.gained, one.lost, one.is_changed) == (1, 1, 2, True)


def test_the_same_result_is_no_change_and_what_it_was_made_with_is_named() -> None:
    one = against(result((0, 50), odds=3, commit="x"), result((0, 50), odds=2, commit="x"))
    assert not one.is_changed and settings_of([one, one]) == {"odds": {("2", "3")}}


def test_a_recording_that_is_new_or_failed_is_no_gain() -> None:
    assert not against(result((0, 50)), None).is_changed
    failed = change(Row.failed(Path("/r/a"), OSError("gone")), None, result((0, 50)))
    assert failed.is_changed and (failed.gained, failed.lost) == (0, 1)


def test_changed_recordings_come_first_and_other_false_constraints_before_all() -> None:
    same, new = against(result((0, 50)), result((0, 50))), against(result(), None)
    many, false = against(result(), result((0, 50), (0, 90))), against(result((0, 50), false=1), result((0, 50)))
    assert ordered([same, new, many, false]) == [false, many, new, same]


def test_a_recording_is_found_by_its_path_or_by_a_name_of_its_own(tmp_path: Path) -> None:
    (tmp_path / "a-00000000.json").touch()
    recordings = [Path("/r/a"), Path("/r/b")]
    assert other_result(tmp_path, "a-00000000.json", recordings) == tmp_path / "a-00000000.json"
    assert other_result(tmp_path, "a-11111111.json", recordings) == tmp_path / "a-00000000.json"
    assert other_result(tmp_path, "a-11111111.json", [*recordings, Path("/s/a")]) is None
    assert other_result(tmp_path, "b-11111111.json", recordings) is None
    (tmp_path / "a-22222222.json").touch()
    assert other_result(tmp_path, "a-11111111.json", recordings) is None


def test_a_result_is_not_changed_by_a_comparison() -> None:
    now, before = result((0, 50)), result((0, 60))
    copies = deepcopy((now, before))
    against(now, before)
    assert (now, before) == copies
