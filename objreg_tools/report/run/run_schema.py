# SPDX-License-Identifier: Apache-2.0
"""The form of the JSON of a run: what a report takes from it, field by field."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from typing import Any

Check = Callable[[Any], bool]


def require_form(name: str, summary: Mapping[str, Any]) -> None:
    """ValueError for the first field that is not as `objreg offline --json` or `objreg demo` writes it.

    Fields that are missing are those of an older version, and no error. What else is in constraints, refusals and
    glimpses is for `RunSummary.of` to say.
    """
    for field, (text, fits) in FIELDS.items():
        if field in summary and not fits(summary[field]):
            got = json.dumps(summary[field], ensure_ascii=False)
            got = got if len(got) <= 80 else f"{got[:80]}…"
            raise ValueError(f"{name}: expected {field} to be {text}, got {got}; run objreg offline again")


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _is_count(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _is_rows(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(row, dict) for row in value)


def _is_findings(value: Any) -> bool:
    return _is_rows(value) and all(isinstance(row.get(key), str) for row in value for key in FINDING)


def _is_glimpses(value: Any) -> bool:
    return _is_rows(value) and all(isinstance(row.get("stamp_ns"), int) for row in value)


def _is_mounting(value: Any) -> bool:
    return isinstance(value, list) and len(value) in (0, 7) and all(map(_is_number, value))


def _is_field(value: Any) -> bool:
    return value is None or (_is_pair(value) and all(0 < degrees < 180 for degrees in value))


def _is_stage(value: Any) -> bool:
    return isinstance(value, dict) and all(_is_number(value.get(name)) for name in ("p50", "p95"))


def _is_pair(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(_is_number, value))


def _is_node(value: Any) -> bool:
    return isinstance(value, dict) and _is_count(value.get("published")) and _each(_is_pair)(value.get("stage_ms"))


def _is_about(value: Any) -> bool:
    """Whether it is what `about` makes; fields may be missing or null."""
    if not isinstance(value, dict):
        return False
    model, params = value.get("model"), value.get("params", {})
    texts = [value.get(key) for key in ("version", "commit", "command", "date", "recording")]
    fits = all(text is None or isinstance(text, str) for text in texts)
    return fits and (model is None or isinstance(model, dict)) and isinstance(params, dict)


def _each(fits: Check) -> Check:
    """Whether a value is an object with such values only."""
    return lambda value: isinstance(value, dict) and all(map(fits, value.values()))


FINDING = ("what", "cause", "todo", "anchor")
FIELDS: dict[str, tuple[str, Check]] = {
    "recording": ("the path of a recording", _is_text),
    "about": ("an object of texts, model and params", _is_about),
    "name": ("text", _is_text),
    "lens": ("text", _is_text),
    "field_of_view_deg": ("two angles or null", _is_field),
    "rectified": ("auto, all or none", lambda value: value in ("auto", "all", "none")),
    "inputs": ("an object of topics by input", _each(_is_text)),
    "camera": ("text", _is_text),
    "T_base_camera": ("seven numbers or none", _is_mounting),
    "frames": ("a count", _is_count),
    "detections": ("a count", _is_count),
    "objects": ("a count", _is_count),
    "assumed": ("an object of texts", _each(_is_text)),
    "findings": ("a list of objects of what, cause, todo and anchor", _is_findings),
    "rejected": ("an object of counts by reason", _each(_is_count)),
    "stage_ms": ("an object of p50 and p95 in ms by stage", _each(_is_stage)),
    "nodes": ("an object of published and stage_ms (p50, p95) by node", _each(_is_node)),
    "constraints": ("a list of objects", _is_rows),
    "refusals": ("a list of objects", _is_rows),
    "glimpses": ("a list of objects with stamp_ns", _is_glimpses),
}
