# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest

from objreg_tools.report.batch.batch_rows import Row
from objreg_tools.report.batch.batch_tables import batch_tables

POSE = np.eye(4).tolist()
ENDS = {"from_ns": 1, "to_ns": 2, "T_from_to": POSE, "evidence": {"odds": 3.0}}


def constraint(error: dict[str, float] | None) -> dict:
    return {**ENDS, "covariance": np.eye(6).tolist(), "labels": ["cup"], "objects": [], "error": error}


def rows_of(folder: Path, name: str) -> list[dict]:
    return pyarrow.parquet.read_table(folder / f"{name}.parquet").to_pylist()


def test_constraints_and_refusals_of_all_recordings_are_rows_with_units(tmp_path: Path) -> None:
    errors = [{"rotation_deg": 1.0, "translation_cm": 2.0}, {"rotation_deg": 9.0, "translation_cm": 2.0}, None]
    refusals = [{**ENDS, "T_from_to": None, "reason": "slack", "detail": "x"}]
    with batch_tables(tmp_path) as tables:
        dark = Row("a", "/a", frames=2, findings=[{"what": "dark", "cause": "night"}])
        tables.add_recording(dark, {"constraints": list(map(constraint, errors)), "refusals": refusals})
        tables.add_recording(Row("b", "/b", error="gone"), None)
    assert [(row["name"], row["frames"], row["error"]) for row in rows_of(tmp_path, "recordings")] == [
        ("a", 2, ""),
        ("b", 0, "gone"),
    ]
    assert [row["findings"] for row in rows_of(tmp_path, "recordings")] == [["dark"], []]
    found = rows_of(tmp_path, "constraints")
    assert [row["false"] for row in found] == [False, True, None] and found[1]["error_rotation_deg"] == 9.0
    assert np.reshape(found[0]["T_from_to"], (4, 4)).tolist() == POSE and found[0]["evidence"] == [("odds", 3.0)]
    assert rows_of(tmp_path, "refusals")[0]["T_from_to"] is None


def test_nothing_of_a_table_stays_where_the_block_fails(tmp_path: Path) -> None:
    with pytest.raises(KeyError), batch_tables(tmp_path):
        raise KeyError
    assert list(tmp_path.iterdir()) == []


def test_without_pyarrow_the_extra_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(ValueError, match=r"pip install 'objreg_ros\[batch\]'"), batch_tables(tmp_path):
        pass


@pytest.mark.parametrize("name", ["recordings", "constraints", "refusals"])
def test_the_tutorial_names_every_column(name: str, tmp_path: Path, repository: Path) -> None:
    with batch_tables(tmp_path):
        pass
    text = (repository / "docs/tutorials/many-recordings.md").read_text(encoding="utf-8")
    (line,) = (line for line in text.splitlines() if line.startswith(f"| `{name}` |"))
    columns = pyarrow.parquet.read_schema(tmp_path / f"{name}.parquet").names
    lacking = [column for column in columns if f"`{column}`" not in line]
    assert not lacking
