# SPDX-License-Identifier: Apache-2.0
"""What is no JSON of a run is refused field by field."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest

from objreg_tools.report.run.run_schema import require_form
from report.runs import summary

BAD: list[tuple[str, Any]] = [
    ("recording", None),
    ("recording", 5),
    ("name", ["a"]),
    ("inputs", []),
    ("inputs", {"image": None}),
    ("T_base_camera", [1, 2]),
    ("field_of_view_deg", [57]),
    ("field_of_view_deg", [57, 180]),
    ("lens", None),
    ("rectified", "yes"),
    ("rectified", []),
    ("frames", "many"),
    ("frames", -1),
    ("detections", None),
    ("objects", 1.5),
    ("rejected", [1]),
    ("rejected", {"low_overlap": "two"}),
    ("stage_ms", {"x": {}}),
    ("stage_ms", {"x": {"p50": 1.0, "p95": None}}),
    ("nodes", {"segmenter": {"stage_ms": {}}}),
    ("nodes", {"segmenter": {"published": 3, "stage_ms": {"x": 5}}}),
    ("constraints", 3),
    ("refusals", [None]),
    ("glimpses", [3]),
    ("glimpses", [{}]),
    ("findings", [{"what": "no more"}]),
    ("about", []),
    ("about", {"model": "ssd.onnx"}),
    ("about", {"params": ["detector.threshold"]}),
    ("about", {"version": 2}),
]


@pytest.mark.parametrize(("field", "value"), BAD)
def test_a_field_of_another_form_is_refused_by_name_with_what_to_do(field: str, value: object) -> None:
    got = re.escape(json.dumps(value))
    message = rf"^run: expected {field} to be .+, got {got}; run objreg offline again$"
    with pytest.raises(ValueError, match=message):
        require_form("run", {**summary(), field: value})


def test_long_values_are_cut() -> None:
    with pytest.raises(ValueError, match="…; run objreg offline again") as error:
        require_form("run", {"frames": "x" * 10_000})
    assert len(str(error.value)) < 200


def test_the_json_of_runs_and_of_older_versions_has_the_form() -> None:
    counters = {"received": 3, "published": 2, "stage_ms": {"segment": [3.0, 5.0]}, "dropped": {}}
    require_form("run", summary())
    require_form("run", {"constraints": []})
    require_form("run", {**summary(), "nodes": {"segmenter": counters}, "T_base_camera": [], "inputs": {"odom": ""}})
