# SPDX-License-Identifier: Apache-2.0
"""A golden file: what a model saw in a recording, and what that gave. A line each, so that git shows what changed."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from objreg_ros.data.images import Detections

FOLDER = Path(__file__).resolve().parent
ROWS = ("constraints", "refusals", "detections")


class Golden(NamedTuple):
    """What a file holds: the ``detections`` by the stamp of their picture, and the ``results`` as `runs.results`."""

    detections: dict[int, Detections]
    results: dict[str, Any]


def path_of(name: str) -> Path:
    """The file of a recording."""
    return FOLDER / f"{name}.json"


def read(name: str) -> Golden:
    """The golden file of a recording; FileNotFoundError where there is none."""
    content = json.loads(path_of(name).read_text(encoding="utf-8"))
    detections = [_detections(row) for row in content.pop("detections")]
    return Golden({of.stamp_ns: of for of in detections}, content)


def text_of(golden: Golden) -> str:
    """The file's text: a line for each constraint, refusal and picture."""
    content = {**golden.results, "detections": [_row(of) for of in golden.detections.values()]}
    fields = [
        f"{json.dumps(name)}: {_lines(content[name]) if name in ROWS else json.dumps(content[name])}"
        for name in content
    ]
    return "{\n" + ",\n".join(fields) + "\n}\n"


def _lines(rows: Iterable[dict[str, Any]]) -> str:
    return "[\n" + ",\n".join(json.dumps(row) for row in rows) + "\n]"


def _row(of: Detections) -> dict[str, Any]:
    return {
        "stamp_ns": of.stamp_ns,
        "frame_id": of.frame_id,
        "image_hw": list(of.image_hw),
        "label": list(of.label),
        "score": of.score.tolist(),
        "xyxy": of.xyxy.tolist(),
    }


def _detections(row: dict[str, Any]) -> Detections:
    """The detections of a row; a float32 survives JSON to the last bit."""
    return Detections(
        xyxy=np.array(row["xyxy"], np.float32).reshape(-1, 4),
        score=np.array(row["score"], np.float32),
        label=tuple(row["label"]),
        image_hw=(row["image_hw"][0], row["image_hw"][1]),
        stamp_ns=row["stamp_ns"],
        frame_id=row["frame_id"],
    )
