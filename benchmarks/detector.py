# SPDX-License-Identifier: Apache-2.0
"""How good and how fast the detector is.

    python benchmarks/detector.py --seed 1 --json OUT [--quick] [--model MODEL] [--coco MODEL] [--pictures FOLDER]

``map50_sim``, ``ap50`` per label: average precision at IoU 0.5 (VOC, all points) on simulated pictures of scenes that
no training has seen (``training/validation.py`` says which), of objects that registration can use: half of it visible,
box of at least 32 x 32 px, which COCO calls medium. ``map50_sim_all``, ``ap50_all``: of everything that is 30 % visible
and has 400 px^2; ``map50_sim_large``, ``ap50_large``: of boxes from 64 x 64 px. What is not asked for is difficult in
VOC's sense, neither a miss nor a false alarm, and so is a wrong box that is smaller than what is asked for.
``objects``, with the same endings: how many are asked for. ``ms_p50``, ``ms_p95``: one 640 x 480 picture through
`Detector.detect` with two threads, and the same of the COCO model in ``coco`` (``--coco``, else
that of a sibling folder `shared`, else what `objreg fetch-model` got) where there is one. ``real``: what is
found on real pictures beside the project; ``found`` counts boxes by label; ``of_truth`` is how many of the labelled
objects (YCB-Video) and ``of_coco`` how many of the COCO model's boxes of the same meaning are met by a box of the right
label at IoU 0.5.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections import Counter
from itertools import takewhile
from pathlib import Path
from typing import Any

import click
import cv2
import numpy as np

REPOSITORY = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(REPOSITORY))

from objreg_ros import share  # noqa: E402
from objreg_ros.data.checked import Array  # noqa: E402
from objreg_ros.data.images import ColourImage, Detections  # noqa: E402
from objreg_ros.detector.boxes import iou  # noqa: E402
from objreg_ros.detector.detector import Detector  # noqa: E402
from objreg_ros.detector.params import DetectorParams  # noqa: E402
from objreg_tools.cli.commands.fetch_model import MODELS  # noqa: E402
from training.validation import EVERYTHING, LARGE, RANKING, REASONABLE, Labelled, look, pictures, precisions  # noqa: E402

SHARED = Path(os.environ.get("OBJREG_SHARED", REPOSITORY.parent / "shared"))
COCO_MODELS = (
    SHARED / "models" / "ssd_mobilenet_v1_coco_int8.onnx",
    *(share.user_models() / MODELS[name].file for name in ("ssd-mobilenet-v1-int8", "ssd-mobilenet-v1")),
)
"""Where a COCO model may be, best first."""
COCO_THRESHOLD = 0.4
Met = dict[str, list[int]]
SAME_MEANING = {"tv": "monitor", "keyboard": "keyboard", "book": "book", "chair": "chair", "bowl": "bowl"}
"""The COCO labels that are one of ours."""
YCB_MEANING = {"003_cracker_box": "cereal_box", "024_bowl": "bowl", "002_master_chef_can": "soda_can"}
"""The YCB objects that are one of ours, or nearly: the can is a tin of coffee, wider than a drinks can."""
REAL = {"ycb_video": "**/*-color.png", "fr2_desk_rgb": "*.jpg", "redkitchen_a": "rgb/*"}
COUNTS = {"pictures": (600, 240), "timings": (200, 60), "redkitchen_a": (50, 8)}
DEMANDS = {"": REASONABLE, "_all": EVERYTHING, "_large": LARGE}
PROCESSES = min(os.cpu_count() or 1, 4)
"""So many make pictures side by side."""
QUICK_S = 30.0
"""A quick run stops making pictures after so long, whatever the machine."""


def simulated(detector: Detector, seed: int, count: int, limit_s: float) -> dict[str, Any]:
    """Average precision on up to ``count`` simulated pictures, as many as fit into the time.

    `click.ClickException` where not even one does.
    """
    begin = time.monotonic()

    def in_time(picture: Labelled) -> bool:
        return time.monotonic() - begin < limit_s

    used = list(takewhile(in_time, pictures(seed, count, PROCESSES)))
    if not used:
        raise click.ClickException(
            f"expected a simulated picture within {limit_s:.0f} s, got none; stop other work, or run it without --quick"
        )
    seen = look(detector, used)
    figures: dict[str, Any] = {"pictures": len(used)}
    for suffix, demand in DEMANDS.items():
        truth = [picture.truth(demand) for picture in used]
        ap50 = precisions(seen, truth, demand)
        figures |= {f"map50_sim{suffix}": ap50.pop("mean"), f"ap50{suffix}": ap50}
        figures[f"objects{suffix}"] = sum(int((~known.difficult).sum()) for known in truth)
    return figures


def timed(detectors: dict[str, Detector], count: int) -> dict[str, dict[str, float]]:
    """Milliseconds of each detector on the same picture, in turns."""
    rgb = next(pictures(seed=0, count=1)).rgb
    image = ColourImage(rgb=rgb, stamp_ns=0)
    spent: dict[str, list[float]] = {name: [] for name in detectors}
    for _ in range(count):
        for name, detector in detectors.items():
            begin = time.perf_counter()
            detector.detect(image)
            spent[name].append((time.perf_counter() - begin) * 1e3)
    return {
        name: {f"ms_p{rank}": round(float(np.percentile(values, rank)), 2) for rank in (50, 95)}
        for name, values in spent.items()
    }


def on_real(
    detector: Detector, coco: Detector | None, folder: Path, count: int | None, out: Path | None
) -> dict[str, Any]:
    """What the detector finds on the pictures of one folder."""
    paths = sorted(folder.glob(REAL[folder.name]))
    paths = paths[:: max(1, len(paths) // count)][:count] if count else paths
    found: Counter[str] = Counter()
    of_truth: Met = {}
    of_coco: Met = {}
    for path in paths:
        image = ColourImage(rgb=np.ascontiguousarray(np.asarray(cv2.imread(str(path)))[..., ::-1]), stamp_ns=0)
        seen = detector.detect(image)
        found.update(seen.label)
        _count(of_truth, seen, *_ycb_truth(path))
        if coco is not None:
            _count(of_coco, seen, *_meaning(coco.detect(image)))
        if out is not None:
            _draw(image.rgb, seen, out / f"{folder.name}_{path.parent.name}_{path.stem}.jpg")
    met = {"of_truth": _text(of_truth), "of_coco": _text(of_coco)}
    return {"pictures": len(paths), "found": dict(sorted(found.items())), **{k: v for k, v in met.items() if v}}


def _count(met: Met, seen: Detections, boxes: Array, labels: list[str]) -> None:
    """Add, by label, how many of the boxes are met by a detection of their label, and how many there are."""
    overlap = iou(boxes, seen.xyxy)
    for row, label in zip(overlap, labels, strict=True):
        counts = met.setdefault(label, [0, 0])
        counts[0] += bool((row[[name == label for name in seen.label]] >= 0.5).any())
        counts[1] += 1


def _text(met: Met) -> dict[str, str]:
    return {label: f"{right} of {total}" for label, (right, total) in sorted(met.items())}


def _meaning(seen: Detections) -> tuple[Array, list[str]]:
    """The COCO model's boxes whose label is one of ours, under our name."""
    rows = [row for row, label in enumerate(seen.label) if label in SAME_MEANING]
    return seen.xyxy[rows], [SAME_MEANING[seen.label[row]] for row in rows]


def _ycb_truth(path: Path) -> tuple[Array, list[str]]:
    """The labelled boxes beside a YCB-Video picture that are one of ours: ``name x_min y_min x_max y_max`` a line."""
    file = path.with_name(path.name.replace("-color.png", "-box.txt"))
    lines = file.read_text().split("\n") if file.suffix == ".txt" and file.is_file() else []
    rows = [line.split() for line in lines if line.split() and line.split()[0] in YCB_MEANING]
    boxes = np.array([[float(number) for number in row[1:5]] for row in rows], np.float32).reshape(-1, 4)
    return boxes, [YCB_MEANING[row[0]] for row in rows]


def _draw(rgb: Array, seen: Detections, path: Path) -> None:
    """The picture with the boxes and their names."""
    picture = np.ascontiguousarray(rgb[..., ::-1])
    for (x0, y0, x1, y1), label, score in zip(seen.xyxy.astype(int).tolist(), seen.label, seen.score, strict=True):
        cv2.rectangle(picture, (x0, y0), (x1, y1), (40, 220, 40), 2)
        cv2.putText(picture, f"{label} {score:.2f}", (x0 + 2, y0 + 14), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (40, 220, 40), 1)
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), picture)


def coco_at_hand(asked: Path | None) -> Path | None:
    """The COCO model that is asked for, or the best one that is there, or None."""
    return asked or next((path for path in COCO_MODELS if path.is_file()), None)


def model_file(_: click.Context, __: click.Parameter, name: str | None) -> Path | None:
    """The file of the model that an option names; `click.BadParameter` where there is none."""
    try:
        return share.model(name) if name else None
    except FileNotFoundError as error:
        raise click.BadParameter(
            f"expected a path, or the name of a file in {share.user_models()} or in models/, got {name!r}; "
            "`objreg fetch-model` gets one"
        ) from error


def load(path: Path, params: DetectorParams) -> Detector:
    """The detector; `click.UsageError` for a file that is no model for it."""
    try:
        return Detector(params, path)
    except ValueError as error:
        raise click.UsageError(str(error)) from error


@click.command()
@click.option("--seed", type=int, default=1, help="Another seed gives other scenes.")
@click.option("--json", "out", type=click.Path(path_type=Path), required=True, help="Where the figures go.")
@click.option("--quick", is_flag=True, help="Fewer pictures: within 50 s.")
@click.option("--model", default=share.EMBEDDED, callback=model_file, help="The model that is measured.")
@click.option(
    "--coco", metavar="MODEL", callback=model_file, help="A COCO model to compare with; default: one at hand."
)
@click.option("--pictures", "folder", type=click.Path(path_type=Path), help="Draw what is found on real pictures here.")
def main(seed: int, out: Path, quick: bool, model: Path, coco: Path | None, folder: Path | None) -> None:
    """Measure the detector."""
    counts = {name: few if quick else many for name, (many, few) in COUNTS.items()}
    ours, coco_path = load(model, DetectorParams(threads=2)), coco_at_hand(coco)
    other = load(coco_path, DetectorParams(threads=2, threshold=COCO_THRESHOLD)) if coco_path else None
    figures = simulated(load(model, RANKING), seed, counts["pictures"], QUICK_S if quick else float("inf"))
    speed = timed({"ours": ours} | ({"coco": other} if other else {}), counts["timings"])
    figures |= {"seed": seed, "model": model.name, **speed["ours"], "coco": speed.get("coco")}
    figures["real"] = {
        name: on_real(ours, other, SHARED / "data" / name, counts.get(name), folder)
        for name in REAL
        if (SHARED / "data" / name).is_dir()
    }
    out.write_text(json.dumps(figures, indent=2) + "\n")
    click.echo(json.dumps(figures, indent=2))


if __name__ == "__main__":
    main()
