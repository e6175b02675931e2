# SPDX-License-Identifier: Apache-2.0
"""From the JSON of runs to the page."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from objreg_ros.recording.inputs import choose_inputs
from objreg_ros.recording.opening import open_recording
from objreg_ros.report.page import page
from objreg_ros.report.pictures import Album
from objreg_ros.report.story import Story
from objreg_ros.truth import Truth


def write_report(out: Path, runs: Sequence[Path]) -> None:
    """Write one page about runs from the files of `objreg offline --json`.

    The recording that a run names gives truth and pictures; where it is gone the page does without. ValueError for a
    file that is no run.
    """
    with ExitStack() as stack:
        chapters = [_chapter(file, stack) for file in runs]
        text = page(chapters)
    out.write_text(text, encoding="utf-8")


def _chapter(file: Path, stack: ExitStack) -> tuple[Story, Album | None]:
    summary = _read(file)
    place = Path(summary.get("recording", ""))
    if not summary.get("recording") or not place.exists():
        return Story.of(file.stem, summary, Truth([])), None
    recording = stack.enter_context(open_recording(place))
    inputs = choose_inputs(recording.topics)
    story = Story.of(place.resolve().name, summary, Truth.of(recording, inputs.ground_truth))
    return story, Album(recording, inputs)


def _read(file: Path) -> Mapping[str, Any]:
    try:
        summary = json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{file}: expected the JSON of `objreg offline --json`, got: {error}") from error
    if not isinstance(summary, dict) or "constraints" not in summary:
        raise ValueError(f"{file}: expected the JSON of `objreg offline --json`, got JSON without constraints")
    return summary
