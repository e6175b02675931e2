# SPDX-License-Identifier: Apache-2.0
"""The least score that a model's own detections should have, as a file beside the model says it."""

from __future__ import annotations

import json
from pathlib import Path

USUAL = 0.5
"""The threshold of a model that says none."""

FILE_BYTES = 1 << 16
"""The longest file that is read."""


def own_threshold(model_path: Path) -> float:
    """The threshold 0..1 of a model: ``threshold`` in the JSON beside it, ``<model>.json``, else `USUAL`.

    ValueError where that file is no JSON object, or the threshold in it no such number.
    """
    file = model_path.with_suffix(".json")
    if not file.is_file():
        return USUAL
    with file.open("rb") as opened:
        text = opened.read(FILE_BYTES)
    try:
        found = json.loads(text).get("threshold", USUAL)
    except (ValueError, AttributeError, RecursionError) as error:
        raise ValueError(f'{file}: expected JSON as {{"threshold": 0.4}}, got {text[:60]!r} ({error})') from error
    if type(found) not in (int, float) or not 0.0 <= found <= 1.0:
        raise ValueError(f"{file}: expected a threshold of 0 to 1, got {str(found)[:60]}")
    return float(found)
