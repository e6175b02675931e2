# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
from pathlib import Path

import pyarrow.parquet
import yaml

from objreg_tools.cli.settings import read_settings
from objreg_tools.report.sweep.sweep_rows import Setting
from objreg_tools.report.sweep.sweep_tables import as_json, as_yaml, write_parquet

from .samples import BLIND, LOW, ODDS, USUAL, found


def test_the_json_has_every_combination_and_the_best() -> None:
    found_all = json.loads(json.dumps(as_json([LOW, USUAL], {"version": "1"})))
    assert found_all["best"]["values"] == {ODDS: 75.0} and found_all["best"]["set"] == [f"{ODDS}=75"]
    assert [one["recall"] for one in found_all["combinations"]] == [0.9, 0.7]
    assert found_all["combinations"][0]["recordings"][0]["false"] == 2
    assert as_json(BLIND, {})["best"] is None


def test_the_yaml_is_a_parameter_file_that_gives_these_values(tmp_path: Path) -> None:
    groups = ("cup mouse", "tv laptop")
    both = Setting({ODDS: 20.0, "segmenter.z_max": 2.5, "registrar.label_groups": groups}, ())
    (tmp_path / "best.yaml").write_text(as_yaml(both))
    changed = read_settings(tmp_path / "best.yaml", ()).changed()
    assert changed == {ODDS: 20.0, "segmenter.z_max": 2.5, "registrar.label_groups": groups}
    assert list(yaml.safe_load(as_yaml(both))) == ["/**/registrar", "/**/segmenter"]


def test_the_table_has_a_row_for_each_combination_and_recording_with_its_values(tmp_path: Path) -> None:
    groups = Setting({ODDS: 5.0, "registrar.label_groups": ("a b",)}, (), 1, (found(error="gone"), found(false=1)))
    write_parquet(tmp_path / "s.parquet", [groups, groups])
    rows = pyarrow.parquet.read_table(tmp_path / "s.parquet").to_pylist()
    assert [(row["combination"], row["error"], row["false"]) for row in rows] == [
        (0, "gone", 0), (0, "", 1), (1, "gone", 0), (1, "", 1),
    ]  # fmt: skip
    assert rows[0][ODDS] == 5.0 and rows[0]["registrar.label_groups"] == ["a b"] and rows[0]["odds"] == [300.0, 90.0]


def test_the_tutorial_names_every_column(tmp_path: Path, repository: Path) -> None:
    write_parquet(tmp_path / "s.parquet", [LOW])
    text = (repository / "docs/tutorials/many-recordings.md").read_text(encoding="utf-8")
    (line,) = (line for line in text.splitlines() if line.startswith("| `sweep` |"))
    lacking = [name for name in pyarrow.parquet.read_schema(tmp_path / "s.parquet").names if f"`{name}`" not in line]
    assert not lacking
