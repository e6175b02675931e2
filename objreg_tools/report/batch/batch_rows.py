# SPDX-License-Identifier: Apache-2.0
"""What became of each recording of a batch, as one row."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any


@dataclass(frozen=True, slots=True)
class Row:
    """One recording. A failed one has an ``error`` and no counts; one without truth no ``strict`` to ``false``."""

    name: str
    recording: str
    file: str = ""  # of its JSON, in the folder of the batch
    error: str = ""
    frames: int = 0
    detections: int = 0
    objects: int = 0
    constraints: int = 0
    revisits: int | None = None  # that constraints close; None where it is not known
    strict: int | None = None
    loose: int | None = None
    false: int | None = None
    rejected: Mapping[str, int] = field(default_factory=dict)
    seconds: float | None = None
    stage_p50_ms: Mapping[str, float] = field(default_factory=dict)
    findings: Sequence[Mapping[str, str]] = ()  # as the JSON has them
    page: str = ""  # of the recording, in the folder of the batch; empty where there is none

    @classmethod
    def of(cls, recording: Path, file: str, summary: Mapping[str, Any]) -> Row:
        """The row of a recording by its JSON."""
        truth = summary["truth"]
        judged: dict[str, Any] = {
            name: truth[name] if truth["count"] else None for name in ("strict", "loose", "false")
        }
        return cls(
            name=recording.name,
            recording=str(recording),
            file=file,
            **{name: summary[name] for name in ("frames", "detections", "objects")},
            constraints=len(summary["constraints"]),
            revisits=summary["batch"].get("revisits"),  # older files lack it
            **judged,
            rejected=summary["rejected"],
            seconds=summary["batch"]["seconds"],
            stage_p50_ms={stage: ms["p50"] for stage, ms in summary["stage_ms"].items()},
            findings=summary["findings"],
        )

    def with_page(self, page: Path) -> Row:
        """The row with its page, where that is there."""
        return replace(self, page=page.name) if page.is_file() else self

    @classmethod
    def failed(cls, recording: Path, error: Exception) -> Row:
        """The row of a recording that did not come to its end, with one line of why."""
        why = " ".join(str(error).split()) or "no reason given"
        is_expected = isinstance(error, OSError | ValueError)
        return cls(recording.name, str(recording), error=why if is_expected else f"{type(error).__name__}: {why}")
