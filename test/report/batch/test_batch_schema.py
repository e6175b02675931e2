# SPDX-License-Identifier: Apache-2.0
"""What fits the schema goes into tables and page; what does not is refused with its name, whatever was edited."""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from objreg_tools.report.batch.batch_page import batch_page
from objreg_tools.report.batch.batch_rows import Row
from objreg_tools.report.batch.batch_schema import require_result
from objreg_tools.report.batch.batch_tables import batch_tables

ENDS = {"from_ns": 2, "to_ns": 1, "T_from_to": np.eye(4).tolist(), "evidence": {"score": 0.5, "rmse": float("nan")}}
RESULT: dict[str, Any] = {
    "recording": "/bag",
    "findings": [{"what": "dark", "cause": "night", "todo": "a lamp", "anchor": "dark"}],
    "frames": 2,
    "detections": 3,
    "objects": 4,
    "constraints": [
        {
            **deepcopy(ENDS),
            "covariance": np.eye(6).tolist(),
            "labels": ["cup"],
            "error": {"rotation_deg": 1.0, "translation_cm": 2},
        }
    ],
    "refusals": [{**deepcopy(ENDS), "T_from_to": None, "reason": "few_points", "detail": "3 of 5"}],
    "rejected": {"few_points": 1},
    "stage_ms": {"total": {"p50": 5.0, "p95": 6.0}},
    "truth": {"count": 1, "strict": 1, "loose": 1, "false": 0},
    "batch": {"made": {"version": "1"}, "seconds": 3.0, "notes": ["a note"], "revisits": 1},
}
FREE = ("version", "p95")
"""What the schema leaves open."""


def places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    yield path
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, one in inner:
        yield from places(one, (*path, key))


def edited(path: tuple[Any, ...], value: Any) -> Any:
    result = deepcopy(RESULT)
    target = result
    for key in path[:-1]:
        target = target[key]
    target[path[-1]] = value
    return result


def write(summary: Any, folder: Path) -> None:
    row = Row.of(Path("bag"), "bag.json", summary)
    with batch_tables(folder) as tables:
        tables.add_recording(row, summary)
    batch_page([row], {})


def test_what_a_batch_writes_fits(tmp_path: Path) -> None:
    require_result(RESULT)
    write(RESULT, tmp_path)


@pytest.mark.parametrize("path", [path for path in places(RESULT) if path], ids=str)
def test_an_edit_of_any_place_is_refused_or_does_no_harm(path: tuple[Any, ...], tmp_path: Path) -> None:
    refused = 0
    for value in (None, True, "text", "\ud800", -1, 1.5, 1 << 80, float("inf"), [], {}, [None], {"a": None}):
        try:
            require_result(edited(path, value))
        except ValueError as error:
            refused += 1
            assert str(path[0]) in str(error) and "expected" in str(error) and len(str(error)) < 300
        else:
            write(edited(path, value), tmp_path)
    assert refused >= 5 or path[-1] in FREE


@pytest.mark.parametrize("path", [p for p in places(RESULT) if p and isinstance(p[-1], str)], ids=str)
def test_a_place_that_is_missing_is_refused_or_does_no_harm(path: tuple[Any, ...], tmp_path: Path) -> None:
    result = deepcopy(RESULT)
    target = result
    for key in path[:-1]:
        target = target[key]
    del target[path[-1]]
    try:
        require_result(result)
    except ValueError as error:
        assert f"to have {path[-1]}" in str(error)
    else:
        write(result, tmp_path)


@pytest.mark.parametrize("value", [None, [], "text", 1, {}])
def test_what_is_no_result_at_all_is_refused(value: Any) -> None:
    with pytest.raises(ValueError, match="result: expected"):
        require_result(value)
