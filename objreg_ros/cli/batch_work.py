# SPDX-License-Identifier: Apache-2.0
"""What is done of each recording of a batch, here or on another machine, and whether it was done before."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

from objreg_ros.cli.recorded import Asked
from objreg_ros.detector.params import DetectorParams
from objreg_ros.recording.troubles import troubles
from objreg_ros.report.about import about
from objreg_ros.report.findings import as_json, find
from objreg_ros.whole_file import write_whole

DIGITS = 8  # of the digest of a recording's path: recordings of one name have files of their own


@dataclass(frozen=True, slots=True)
class BatchWork:
    """Runs recordings into JSON files of a ``folder``. ``made`` is what every result depends on, by name."""

    asked: Asked
    folder: Path
    arguments: tuple[str, ...]
    made: Mapping[str, Any]

    @classmethod
    def of(cls, asked: Asked, folder: Path, arguments: tuple[str, ...]) -> BatchWork:
        """The work of these settings; OSError where there is no such model."""
        model = asked.settings.of("detector", DetectorParams).model
        told = about(Path(), model, asked.settings.changed(), arguments)
        made = {name: told[name] for name in ("version", "commit", "model")}
        made |= {"odometry": asked.odometry, "remaps": list(asked.remaps), "max_frames": asked.max_frames}
        return cls(asked, folder, arguments, made | told["params"])

    def __call__(self, recording: Path) -> None:
        """Run one recording and write its JSON whole, unless that is there already. OSError, ValueError as the run."""
        if self.differing(recording) == []:
            return
        start = time.perf_counter()
        with self.asked.opened(recording) as opened:
            summary = opened.summary(opened.run(), self.arguments)
            summary["findings"] = as_json(find(summary, troubles(opened.source, opened.inputs)))
            notes = list(opened.notes)
        seconds = round(time.perf_counter() - start, 3)
        batch = {"made": self._made_of(recording), "seconds": seconds, "notes": notes}
        write_whole(self.file(recording), json.dumps({**summary, "batch": batch}, indent=1))

    def file(self, recording: Path) -> Path:
        """The JSON of a recording."""
        digest = sha256(str(recording).encode(errors="surrogateescape")).hexdigest()[:DIGITS]
        return self.folder / f"{recording.name}-{digest}.json"

    def read(self, recording: Path) -> dict[str, Any] | None:
        """The JSON of a recording; None where none is there whole."""
        try:
            summary = json.loads(self.file(recording).read_bytes())
        except (OSError, ValueError):
            return None
        return summary if isinstance(summary, dict) and "batch" in summary else None

    def differing(self, recording: Path) -> list[str] | None:
        """By what a result of before was made otherwise: nothing where it holds, None where there is none."""
        summary = self.read(recording)
        if summary is None:
            return None
        before, now = summary["batch"]["made"], json.loads(json.dumps(self._made_of(recording)))
        return sorted(name for name in before.keys() | now.keys() if before.get(name) != now.get(name))

    def _made_of(self, recording: Path) -> dict[str, Any]:
        return {**self.made, "recording": asdict(_Extent.of(recording))}


@dataclass(frozen=True, slots=True)
class _Extent:
    """What tells a recording from one that was written over it."""

    bytes: int
    changed_ns: int

    @classmethod
    def of(cls, recording: Path) -> _Extent:
        told = [file.stat() for file in _files(recording)]
        return cls(sum(one.st_size for one in told), max((one.st_mtime_ns for one in told), default=0))


def _files(recording: Path) -> Iterator[Path]:
    return (file for file in (recording, *recording.rglob("*")) if file.is_file())
