# SPDX-License-Identifier: Apache-2.0
"""The work of a sweep: runs of one recording that share what was detected, and the revisits that there were in it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from hashlib import blake2b
from itertools import groupby
from pathlib import Path
from typing import Any

from objreg_ros import share
from objreg_ros.data.images import ColourImage, Detections
from objreg_ros.detector.params import DetectorParams
from objreg_ros.whole_file import write_whole
from objreg_tools.cli.many.batch_work import BatchWork
from objreg_tools.offline.stages import Detects
from objreg_tools.report.run.pictures import Album
from objreg_tools.report.run.revisits import Revisit
from objreg_tools.report.sweep.revisits_of_run import revisits_in
from objreg_tools.workers import report_progress

MOST_BYTES = 1 << 29  # of the masks of a recording that are remembered; what is beyond is detected again
MOST_FILE_BYTES = 1 << 24  # of revisits
# what the revisits of a recording depend on
MADE_OF = ("recording", "remaps", "version", "commit", "segmenter.camera", "segmenter.source")


class Remembering:
    """A detector that is asked once about each picture. ``make`` builds it when the first picture comes."""

    def __init__(self, make: Callable[[], Detects]) -> None:
        self._make = make
        self._detector: Detects | None = None
        self._seen: dict[tuple[int, str, bytes], Detections] = {}
        self._bytes = 0

    def detect(self, image: ColourImage) -> Detections:
        """As the detector does."""
        key = (image.stamp_ns, image.frame_id, blake2b(image.rgb.tobytes(), digest_size=16).digest())
        if key in self._seen:
            return self._seen[key]
        self._detector = self._detector or self._make()
        found = self._detector.detect(image)
        size = 0 if found.instances is None else found.instances.nbytes
        if self._bytes + size <= MOST_BYTES:
            self._bytes += size
            self._seen[key] = found
        return found


@dataclass(frozen=True, slots=True)
class RevisitsFile:
    """Where the revisits of a recording are kept, and a run by whose settings it is opened."""

    folder: Path
    run: BatchWork

    def read(self, recording: Path) -> list[Revisit] | None:
        """None where they are not there, or of another recording, other inputs or another program."""
        try:
            file = self._file(recording)
            kept = json.loads(file.read_bytes()) if file.stat().st_size <= MOST_FILE_BYTES else {}
            found = [Revisit(int(a), int(b), float(turn), float(share)) for a, b, turn, share in kept["revisits"]]
            return found if kept["made"] == self._made(recording) else None
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            return None

    def write(self, recording: Path) -> None:
        """Find them and write them whole; OSError, ValueError as the recording raises them."""
        with self.run.asked.opened(recording) as opened:
            found = revisits_in(opened.truth, Album(opened.source, opened.inputs))
        rows = [[one.from_ns, one.to_ns, one.view_change_deg, one.overlap] for one in found]
        self.folder.mkdir(parents=True, exist_ok=True)
        write_whole(self._file(recording), json.dumps({"made": self._made(recording), "revisits": rows}))

    def _file(self, recording: Path) -> Path:
        return self.folder / self.run.file(recording).name

    def _made(self, recording: Path) -> Any:
        made = self.run.made_of(recording)
        return json.loads(json.dumps({name: made.get(name) for name in MADE_OF}))


@dataclass(frozen=True, slots=True)
class Share:
    """Runs of one recording that detect the same, for one worker; ``revisits`` asks for these too."""

    recording: Path
    runs: tuple[BatchWork, ...]
    revisits: RevisitsFile | None = None


@dataclass(frozen=True, slots=True)
class Failures:
    """What failed in a share, in one line each: runs by their folder, and the revisits."""

    runs: dict[str, str] = field(default_factory=dict)
    revisits: str = ""


def work(share_of: Share) -> Failures:
    """Do all runs of a share, each of which writes its JSON whole; one that fails stops no other."""
    failures, count = Failures(), len(share_of.runs)
    detects = _detector(share_of.runs[0]) if share_of.runs else None
    for number, run in enumerate(share_of.runs):
        try:
            run.run(share_of.recording, partial(_report, number, count), detects)
        except Exception as error:  # as a worker does with a recording
            failures.runs[str(run.folder)] = _in_a_line(error)
    try:
        if share_of.revisits is not None:
            share_of.revisits.write(share_of.recording)
    except Exception as error:
        return Failures(failures.runs, _in_a_line(error))
    return failures


def _report(number: int, count: int, done: int, of: int) -> None:
    """How far the run of this number is, as frames of all ``count`` runs."""
    report_progress(number * of + done, count * of)


def shares(recording: Path, runs: Sequence[BatchWork], revisits: RevisitsFile | None) -> list[Share]:
    """What is to be done with a recording: a share for each detector, and its revisits with the first."""
    groups = [tuple(group) for _, group in groupby(sorted(runs, key=_detection), key=_detection)]
    if revisits is None:
        return [Share(recording, group) for group in groups]
    first, *others = groups or [()]
    return [Share(recording, first, revisits), *(Share(recording, group) for group in others)]


def split(groups: Sequence[Share], workers: int) -> list[Share]:
    """The shares, in pieces where there are more workers than these. What is in several pieces is detected again."""
    pieces = -(-workers // max(1, len(groups)))
    return [piece for group in groups for piece in _split(group, pieces)]


def _split(group: Share, pieces: int) -> Iterator[Share]:
    size = max(1, -(-len(group.runs) // pieces))
    yield Share(group.recording, group.runs[:size], group.revisits)
    for start in range(size, len(group.runs), size):
        yield Share(group.recording, group.runs[start : start + size])


def _detection(run: BatchWork) -> str:
    """What detections depend on."""
    changed = run.asked.settings.changed()
    return json.dumps({name: changed[name] for name in sorted(changed) if name.startswith("detector.")}, default=str)


def _detector(run: BatchWork) -> Remembering:
    from objreg_ros.detector.detector import Detector

    params = run.asked.settings.of("detector", DetectorParams)
    return Remembering(lambda: Detector.of(params, share.model))


def _in_a_line(error: Exception) -> str:
    why = " ".join(str(error).split()) or "no reason given"
    return why if isinstance(error, OSError | ValueError) else f"{type(error).__name__}: {why}"
