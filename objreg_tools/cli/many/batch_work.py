# SPDX-License-Identifier: Apache-2.0
"""The work on each recording of a batch, here or on another machine, and whether it was done before."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

from objreg_ros.detector.params import DetectorParams
from objreg_ros.whole_file import write_whole
from objreg_tools.cli.recorded import RecordedOptions
from objreg_tools.offline.stages import Detects
from objreg_tools.recording.troubles import troubles
from objreg_tools.report.batch.batch_schema import require_result
from objreg_tools.report.run.about import about
from objreg_tools.report.run.findings import as_json, find
from objreg_tools.report.run.run_summary import RunSummary
from objreg_tools.report.write import write_report
from objreg_tools.workers import report_progress

MOST_BYTES = 1 << 28  # of a result: eight hours at 30 Hz
DIGITS = 8  # of the digest of a recording's path: recordings of one name have files of their own


@dataclass(frozen=True, slots=True)
class BatchWork:
    """Runs recordings into JSON files of a ``folder``. ``made`` is what every result depends on, by name.

    With ``pages`` each recording has its page there too.
    """

    asked: RecordedOptions
    folder: Path
    arguments: tuple[str, ...]
    made: Mapping[str, Any]
    pages: bool = False

    @classmethod
    def of(cls, asked: RecordedOptions, folder: Path, arguments: tuple[str, ...], pages: bool = False) -> BatchWork:
        """The work of these settings; OSError where there is no such model."""
        model = asked.settings.of("detector", DetectorParams).model
        facts = about(Path(), model, asked.settings.changed(), arguments)
        made = {name: facts[name] for name in ("version", "commit", "model")}
        made |= {"odometry": asked.odometry, "remaps": list(asked.remaps), "max_frames": asked.max_frames}
        return cls(asked, folder, arguments, made | facts["params"], pages)

    def __call__(self, recording: Path) -> str:
        """Run one recording and write its JSON and its page whole, unless they are there already.

        Gives back why there is no page, in one line; nothing where there is one or none was asked for. OSError,
        ValueError as the run.
        """
        if not self.is_done(recording):
            self.run(recording, report_progress)
        return self._write_page(recording) if self.lacks_page(recording) else ""

    def run(self, recording: Path, on_frame: Callable[[int, int], None], detects: Detects | None = None) -> None:
        """Run one recording and write its JSON whole.

        ``on_frame`` receives how many frames are through, and of how many. ``detects`` takes the place of the detector.
        OSError, ValueError as the run.
        """
        _require_plain(self.file(recording))
        self.page(recording).unlink(missing_ok=True)  # it shows another run
        start = time.perf_counter()
        with self.asked.opened(recording) as opened:
            frames = opened.frames
            run = opened.run(on_frame=lambda done: on_frame(done, frames), detects=detects)
            summary = opened.summary(run, self.arguments)
            summary["findings"] = as_json(find(summary, troubles(opened.source, opened.inputs)))
            notes = list(opened.notes)
            revisits = RunSummary.of(recording.name, summary, opened.truth).closed_revisits.count
        seconds = round(time.perf_counter() - start, 3)
        batch = {"made": self.made_of(recording), "seconds": seconds, "notes": notes, "revisits": revisits}
        write_whole(self.file(recording), json.dumps({**summary, "batch": batch}, indent=1))

    def file(self, recording: Path) -> Path:
        """The JSON of a recording."""
        digest = sha256(str(recording).encode(errors="surrogateescape")).hexdigest()[:DIGITS]
        return self.folder / f"{recording.name}-{digest}.json"

    def page(self, recording: Path) -> Path:
        """The page of a recording, beside its JSON."""
        return self.file(recording).with_suffix(".html")

    def lacks_page(self, recording: Path) -> bool:
        """Whether its page is asked for and not there."""
        return self.pages and not self.page(recording).exists()

    def _write_page(self, recording: Path) -> str:
        """Why it could not be written; the results are there all the same."""
        try:
            write_report(self.page(recording), [self.file(recording)])
        except Exception as error:  # a bug in a drawing is no reason to lose the run
            return f"no page: {' '.join(str(error).split()) or type(error).__name__}"
        return ""

    def read(self, recording: Path) -> dict[str, Any] | None:
        """The JSON of a recording; None where none is there, ValueError where it is not what a batch writes."""
        file = self.file(recording)
        return read_result(file) if file.exists() else None

    def differing(self, recording: Path) -> list[str] | None:
        """By what a result of before was made otherwise: nothing where it holds, None where there is none.

        ValueError where what is there is no result of a batch.
        """
        summary = self.read(recording)
        if summary is None:
            return None
        before, now = summary["batch"]["made"], json.loads(json.dumps(self.made_of(recording)))
        return sorted(name for name in before.keys() | now.keys() if before.get(name) != now.get(name))

    def is_done(self, recording: Path) -> bool:
        """Whether there is a result that holds."""
        try:
            return self.differing(recording) == []
        except ValueError:
            return False

    def made_of(self, recording: Path) -> dict[str, Any]:
        """What the result of a recording depends on, by name."""
        return {**self.made, "recording": asdict(_Extent.of(recording))}


def read_result(file: Path) -> dict[str, Any]:
    """The JSON of a recording in the folder of a batch; ValueError where it is not what a batch writes."""
    try:
        _require_plain(file)
        summary: dict[str, Any] = json.loads(_read_bounded(file))
        require_result(summary)
    except (OSError, ValueError, RecursionError) as error:
        raise ValueError(f"{file}: expected a result of a batch, got one that cannot be used: {error}") from error
    return summary


@dataclass(frozen=True, slots=True)
class _Extent:
    """What distinguishes a recording from one that was written over it."""

    bytes: int
    changed_ns: int

    @classmethod
    def of(cls, recording: Path) -> _Extent:
        stats = [file.stat() for file in _files(recording)]
        return cls(sum(one.st_size for one in stats), max((one.st_mtime_ns for one in stats), default=0))


def _files(recording: Path) -> Iterator[Path]:
    return (file for file in (recording, *recording.rglob("*")) if file.is_file())


def _require_plain(file: Path) -> None:
    """OSError for what would be waited for, as a pipe, or cannot be replaced, as a folder."""
    if file.exists() and not file.is_file():
        raise OSError(f"{file}: expected a plain file or none, got something else; remove it")


def _read_bounded(file: Path) -> bytes:
    size = file.stat().st_size
    if size > MOST_BYTES:
        raise ValueError(f"expected at most {MOST_BYTES} bytes, got {size}")
    return file.read_bytes()
