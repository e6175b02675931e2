# SPDX-License-Identifier: Apache-2.0
"""Are exported labels right? Those of simulated recordings against the true boxes and masks.

    python benchmarks/labels.py --json OUT [--seed 71] [--frames 240] [--every 3]
    python benchmarks/labels.py --recording REC --json OUT

Of each frame, `objreg export-labels` against truth. ``iou_box`` and ``iou_mask`` are the medians of the labels that are
right: their box has an IoU of 0.5 or more with that of an object. ``precision`` is the share of right labels, of all
(``all``), of objects that the detector named (``named``) and of those without a name (``thing``), which may also be
pieces of furniture, of which there are no true boxes. ``right_class`` is the share of the right labels of named objects
whose class is true. ``recall`` is the share of true boxes that are found, of the nine classes, 30 % visible and 300
pixels large, ``recall_known`` that of objects that are labelled anywhere in the recording. ``detector`` has the recall
of the detector alone in the same frames, whose threshold is the default.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import click
import numpy as np

from objreg_ros import share
from objreg_ros.data.checked import Array
from objreg_ros.data.frames import UNNAMED
from objreg_ros.data.images import ColourImage
from objreg_ros.detector.boxes import iou
from objreg_ros.detector.detector import Detector
from objreg_ros.detector.params import DetectorParams
from objreg_tools.cli.commands.export_labels import run_on_map
from objreg_tools.cli.recorded import RecordedOptions
from objreg_tools.report.labels.label_export import LEAST_VIEWS
from objreg_tools.report.labels.labelled_pictures import LEAST_SHARE, LabelledPicture, labelled_pictures
from objreg_tools.report.run.pictures import Album
from objreg_tools.simulation.truth import TrueFrame, TrueSight, read_truth
from objreg_tools.simulation.write import simulate

SCENARIOS = ("loop", "moved", "orbit")
RIGHT_IOU = 0.5
LEAST_PIXELS = 300  # of a true object that is to be found


@dataclass
class Tally:
    """What the frames of one recording gave: a row of each label, and of each true box that is to be found."""

    labels: list[dict[str, Any]] = field(default_factory=list)
    sights: list[dict[str, Any]] = field(default_factory=list)

    def add(self, picture: LabelledPicture, frame: TrueFrame, mask: Array, detected: Array) -> None:
        """Judge one picture; ``mask`` has the true instances, ``detected (N, 4)`` the detector's boxes."""
        boxes = np.array([part.xyxy for part in picture.parts], np.float32).reshape(-1, 4)
        true = np.array([sight.xyxy for sight in frame.seen], np.float32).reshape(-1, 4)
        overlap, seen = iou(boxes, true), iou(detected, true)
        for row, part in zip(overlap, picture.parts, strict=True):
            best = int(row.argmax()) if len(row) else -1
            sight = frame.seen[best] if best >= 0 else None
            inside = np.zeros(mask.shape, bool)
            inside[part.window] = part.mask
            self.labels.append({
                "label": part.object.label, "iou": float(row.max(initial=0.0)), "instance": _number(sight),
                "true": "" if sight is None else sight.object.label,
                "iou_mask": 0.0 if sight is None else _mask_iou(inside, mask == sight.object.instance),
            })  # fmt: skip
        for k, sight in enumerate(frame.seen):
            if sight.visibility >= LEAST_SHARE and sight.pixels >= LEAST_PIXELS and not sight.object.is_distractor:
                best_of = (float(table[:, k].max(initial=0.0)) for table in (overlap, seen))
                found, detector = (value >= RIGHT_IOU for value in best_of)
                self.sights.append({"instance": _number(sight), "found": found, "detector": detector})

    def figures(self) -> dict[str, Any]:
        """The row of a recording; see the top of this file."""
        right = [row for row in self.labels if row["iou"] >= RIGHT_IOU]
        known = {row["instance"] for row in right}
        named = [row for row in right if row["label"] != UNNAMED]
        of_known = [row for row in self.sights if row["instance"] in known]
        return {
            "labels": len(self.labels),
            "iou_box": _median([row["iou"] for row in right]),
            "iou_mask": _median([row["iou_mask"] for row in right]),
            "precision": {name: _share([row["iou"] >= RIGHT_IOU for row in of]) for name, of in self._kinds().items()},
            "right_class": _share([row["label"] == row["true"] for row in named if row["true"]]),
            "recall": _share([row["found"] for row in self.sights]),
            "recall_known": _share([row["found"] for row in of_known]),
            "detector": _share([row["detector"] for row in self.sights]),
        }

    def _kinds(self) -> dict[str, list[dict[str, Any]]]:
        named = [row for row in self.labels if row["label"] != UNNAMED]
        return {"all": self.labels, "named": named, UNNAMED: [r for r in self.labels if r["label"] == UNNAMED]}


def judge(recording: Path, every: int, model: str | None = None) -> tuple[Tally, int]:
    """The tally of a simulated recording, and how many objects its labels are of."""
    asked = RecordedOptions.of(model, None, "", None, [], (), None, None)
    truth, tally, detector = read_truth(recording), Tally(), Detector.of(DetectorParams(), share.model)
    at = {frame.stamp_ns: frame for frame in truth.frames}
    with asked.opened(recording) as opened, TemporaryDirectory() as folder:
        found, objects, summary = run_on_map(opened, Path(folder, "keyframes.db"))
        objects = tuple(one for one in objects if len(one.views) >= LEAST_VIEWS)
        poses = [(frame.stamp_ns, frame.T_map_camera) for frame in found.map.frames][::every]
        for picture in labelled_pictures(objects, poses, Album(opened.source, opened.inputs, summary["rectified"])):
            seen = detector.detect(ColourImage(rgb=picture.rgb, stamp_ns=picture.stamp_ns))
            tally.add(picture, at[picture.stamp_ns], truth.mask(picture.stamp_ns), seen.xyxy)
    return tally, len(objects)


def _number(sight: TrueSight | None) -> int:
    """The number of a true object, 0 of none; what is rearranged keeps its own."""
    return 0 if sight is None else sight.object.instance


def _mask_iou(a: Array, b: Array) -> float:
    return float((a & b).sum() / max(1, (a | b).sum()))


def _median(values: Sequence[float]) -> float | None:
    return round(float(np.median(values)), 3) if values else None


def _share(values: Sequence[bool]) -> float | None:
    return round(float(np.mean(values)), 3) if values else None


def table(rows: dict[str, dict[str, Any]]) -> str:
    """The rows as text."""
    head = ("recording", "objects", "labels", "box IoU", "mask IoU", "precision", "named", "thing", "class", "recall",
            "of known", "detector")  # fmt: skip
    lines = [head, *((name, *map(_text, _flat(row))) for name, row in rows.items())]
    widths = [max(len(line[k]) for line in lines) for k in range(len(head))]
    return "\n".join("  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)) for line in lines)


def _flat(row: dict[str, Any]) -> list[Any]:
    return [row["objects"], row["labels"], row["iou_box"], row["iou_mask"], *row["precision"].values(),
            *(row[name] for name in ("right_class", "recall", "recall_known", "detector"))]  # fmt: skip


def _text(value: float | int | None) -> str:
    return "-" if value is None else str(value) if isinstance(value, int) else f"{value:.3f}"


@click.command()
@click.option("--recording", "recordings", multiple=True, type=click.Path(exists=True, path_type=Path))
@click.option("--seed", type=int, default=71, show_default=True, help="Of the first scenario; the others follow it.")
@click.option("--frames", type=int, default=240, show_default=True)
@click.option("--every", type=int, default=3, show_default=True)
@click.option("--json", "json_path", type=click.Path(dir_okay=False, path_type=Path))
def command(recordings: tuple[Path, ...], seed: int, frames: int, every: int, json_path: Path | None) -> None:
    """Judge the labels of simulated recordings."""
    rows: dict[str, dict[str, Any]] = {}
    with TemporaryDirectory() as folder:
        for k, scenario in enumerate(() if recordings else SCENARIOS):
            simulate(Path(folder, scenario), scenario, seed + k, frames, jpeg=True)
        for recording in recordings or tuple(Path(folder, scenario) for scenario in SCENARIOS):
            tally, objects = judge(recording, every)
            rows[recording.name] = {"objects": objects, **tally.figures()}
            click.echo(table(rows).splitlines()[-1], err=True)
    click.echo(table(rows))
    if json_path is not None:
        json_path.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    command()
