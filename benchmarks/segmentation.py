# SPDX-License-Identifier: Apache-2.0
"""Is it the whole object and nothing but the object? Ours and the founding filter by true masks, and how long it takes.

    python benchmarks/segmentation.py --seed 0 --json OUT [--quick]
    python benchmarks/segmentation.py --recording REC --model MODEL

Intersection over union of the returned points and the object's true points, both as pixels. ``sim``: rooms of the
simulator, objects of the nine classes that are at least 60 % visible within 1.75 m, boxes up to 10 % too large at each
edge. ``mosd``: labelled Kinect clouds of cluttered tables, each edge of a box off by up to 10 % of its size, inwards or
outwards: no method gets what is outside its box (``iou_median_mosd_limit``). Milliseconds are those of a whole frame
with four boxes in a stream of 30 Hz that is a second old, by the clock and (``cpu_``) of all threads. ``ratio_open3d``
is the time that Open3D's removal of the largest plane of each of the four boxes takes alone, divided by ours.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import click
import cv2
import numpy as np
from labelled_images import LabelledImage, LabelledObject, detections, jittered, labelled_clouds, simulated_images

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import ObjectCloud
from objreg_ros.segmenter.objects.boxes import pixel_boxes
from objreg_ros.segmenter.params import SegmenterParams
from objreg_ros.segmenter.segment import Segmenter

OURS, PAPER = "ours", "paper"
JITTER = {"sim": (0.0, 0.1), "mosd": (-0.1, 0.1)}
BOXES = 4  # of a timed frame
PERIOD_NS = 33_333_333  # of the stream that a timed image is of
FIRST = 30  # frames of it that are not timed: a new stream is measured in each
TILE, COLUMNS, ROWS = 200, 7, 6
RIGHT, TOO_MUCH, MISSED = (0, 120, 0), (120, 0, 0), (0, 0, 120)


@dataclass(frozen=True)
class Result:
    """One object of one image by one method."""

    source: str
    method: str
    label: str
    iou: float
    limit: float
    tile: Array | None


def pixels_of(cloud: ObjectCloud | None, labelled: LabelledImage) -> Array:
    """(H, W) bool: where the points of a cloud are in the image."""
    camera = labelled.image.intrinsics
    mask = np.zeros(labelled.image.depth.shape, bool)
    if cloud is not None:
        x, y, z = cloud.xyz.T
        mask[np.rint(camera.fy * y / z + camera.cy).astype(int), np.rint(camera.fx * x / z + camera.cx).astype(int)] = (
            True
        )
    return mask


def judge(labelled: LabelledImage, source: str, method: str, segmenter: Segmenter, rng: Any) -> Iterable[Result]:
    """Every object of an image by one method."""
    boxes = [jittered(target.xyxy, *JITTER[source], rng) for target in labelled.objects]
    asked = detections(boxes, [str(k) for k in range(len(boxes))], labelled.image)
    clouds = {cloud.label: cloud for cloud in segmenter.segment(asked, labelled.image).objects}
    for k, (target, box) in enumerate(
        zip(labelled.objects, pixel_boxes(asked, *labelled.image.depth.shape), strict=True)
    ):
        got = pixels_of(clouds.get(str(k)), labelled)
        iou = float((got & target.mask).sum() / max(1, (got | target.mask).sum()))
        x0, y0, x1, y1 = box
        limit = float(target.mask[y0:y1, x0:x1].sum() / target.mask.sum())
        tile = draw(labelled, target, got, box, f"{iou:.2f} {target.label} {labelled.name}") if method == OURS else None
        yield Result(source, method, target.label, iou, limit, tile)


def draw(
    labelled: LabelledImage, target: LabelledObject, got: Array, box: tuple[int, int, int, int], title: str
) -> Array:
    """A picture of one result: right green, too much red, missed blue."""
    assert labelled.image.rgb is not None
    picture = labelled.image.rgb.copy()
    for mask, colour in ((got & target.mask, RIGHT), (got & ~target.mask, TOO_MUCH), (target.mask & ~got, MISSED)):
        picture[mask] = picture[mask] // 2 + np.array(colour, np.uint8)
    x0, y0, x1, y1 = box
    cv2.rectangle(picture, (x0, y0), (x1, y1), (255, 255, 0), 1)
    margin = max(x1 - x0, y1 - y0) // 3
    part = picture[max(0, y0 - margin) : y1 + margin, max(0, x0 - margin) : x1 + margin]
    tile = cv2.resize(np.ascontiguousarray(part), (TILE, TILE))
    cv2.putText(tile, title, (3, 12), cv2.FONT_HERSHEY_SIMPLEX, 0.4, (255, 255, 255), 1)
    return np.asarray(tile)


def contact_sheet(results: list[Result], path: Path) -> None:
    """The pictures of ours, the worst first."""
    worst = sorted(results, key=lambda r: r.iou)
    tiles = [r.tile for r in worst if r.tile is not None][: COLUMNS * ROWS]
    tiles += [np.zeros((TILE, TILE, 3), np.uint8)] * (-len(tiles) % COLUMNS)
    rows = [np.hstack(tiles[k : k + COLUMNS]) for k in range(0, len(tiles), COLUMNS)]
    cv2.imwrite(str(path), np.vstack(rows)[..., ::-1])


def remove_planes(labelled: LabelledImage, boxes: list[tuple[int, int, int, int]]) -> None:
    """What the founding method does first, by Open3D: the largest plane out of each box."""
    import open3d

    image, camera = labelled.image, labelled.image.intrinsics
    for x0, y0, x1, y1 in boxes:
        z = image.depth[y0:y1, x0:x1]
        x, y = (np.arange(x0, x1) - camera.cx) / camera.fx, (np.arange(y0, y1) - camera.cy) / camera.fy
        points = np.stack([x[None, :] * z, y[:, None] * z, z], axis=-1)[(z > 0) & (z < FARTHEST_PAPER)]
        if len(points) >= 50:
            cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points.astype(np.float64)))
            _, on_plane = cloud.segment_plane(0.01, 3, 200)
            cloud.select_by_index(on_plane, invert=True)


FARTHEST_PAPER = SegmenterParams(preset=PAPER).limits[1]


def timings(images: list[LabelledImage], repeats: int, rng: Any) -> dict[str, float]:
    """Milliseconds a frame of four boxes, and Open3D's time over ours."""
    wall, cpu, ratios = [], [], []
    for labelled in images:
        four = [jittered(labelled.objects[k % len(labelled.objects)].xyxy, 0.0, 0.1, rng) for k in range(BOXES)]
        asked = detections(four, ["object"] * BOXES, labelled.image)
        boxes, segmenter = pixel_boxes(asked, *labelled.image.depth.shape), Segmenter()
        stream = [replace(labelled.image, stamp_ns=k * PERIOD_NS) for k in range(FIRST + repeats)]
        own = [_clock(partial(segmenter.segment, asked, image)) for image in stream][FIRST:]
        theirs = [_clock(partial(remove_planes, labelled, boxes)) for _ in range(max(1, repeats // 4))]
        wall += [w for w, _ in own]
        cpu += [c for _, c in own]
        ratios.append(float(np.median([c for _, c in theirs]) / np.mean([c for _, c in own])))
    named = {"ms": wall, "cpu_ms": cpu}
    found = {f"{name}_p{p}": round(float(np.percentile(v, p)), 3) for name, v in named.items() for p in (50, 95)}
    return {**found, "ratio_open3d": round(float(np.median(ratios)), 2)}


def _clock(work: Callable[[], Any]) -> tuple[float, float]:
    wall, cpu = time.perf_counter(), time.process_time()
    work()
    return 1e3 * (time.perf_counter() - wall), 1e3 * (time.process_time() - cpu)


def summary(results: list[Result]) -> dict[str, Any]:
    """The figures of ours, by class, and the same of the founding filter."""
    found: dict[str, Any] = {}
    for source in JITTER:
        own = [r for r in results if (r.source, r.method) == (source, OURS)]
        if not own:
            continue
        ious = np.array([r.iou for r in own])
        found[f"n_{source}"] = len(own)
        found[f"iou_median_{source}"] = _round(np.median(ious))
        found[f"iou_p10_{source}"] = _round(np.percentile(ious, 10))
        found[f"frac08_{source}"] = _round(np.mean(ious > 0.8))
        found[f"iou_median_{source}_limit"] = _round(np.median([r.limit for r in own]))
        theirs = [r.iou for r in results if (r.source, r.method) == (source, PAPER)]
        found[f"paper_iou_median_{source}"] = _round(np.median(theirs)) if theirs else None
        found[f"paper_frac08_{source}"] = _round(np.mean(np.array(theirs) > 0.8)) if theirs else None
    found["by_class"] = {m: _by_class([r for r in results if r.method == m]) for m in (OURS, PAPER)}
    return found


def _by_class(results: list[Result]) -> dict[str, Any]:
    grouped: dict[str, list[float]] = {}
    for r in results:
        grouped.setdefault(f"{r.source} {r.label}", []).append(r.iou)
    return {
        name: {"n": len(v), "iou_median": _round(np.median(v)), "iou_p10": _round(np.percentile(v, 10))}
        for name, v in sorted(grouped.items())
    }


def _round(value: Any) -> float:
    return round(float(value), 4)


def _render(seed: int, count: int) -> list[LabelledImage]:
    return list(simulated_images(seed, count))


def measure(seed: int, clouds: Path, quick: bool) -> tuple[dict[str, Any], list[Result]]:
    """All figures, and every result."""
    rng = np.random.default_rng(seed)
    methods = {OURS: Segmenter(), PAPER: Segmenter(SegmenterParams(preset=PAPER))}
    with ProcessPoolExecutor(1, get_context("spawn")) as beside:
        rendered = beside.submit(_render, seed, 20 if quick else 100)
        tables = list(labelled_clouds(clouds)) if clouds.is_dir() else []
        rooms = rendered.result()
    results: list[Result] = []
    work = [("sim", image, 1) for image in rooms] + [("mosd", image, 2 if quick else 10) for image in tables]
    with click.progressbar(work, label="segmenting") as bar:
        for source, image, jitters in bar:
            for method, segmenter in methods.items():
                for _ in range(jitters if method == OURS else 1):
                    results += judge(image, source, method, segmenter, rng)
    timed = (tables + rooms)[: 12 if quick else 60]
    figures = {"seed": seed, "quick": quick, **summary(results)}
    return {**figures, **timings(timed, 12 if quick else 24, rng)}, results


@click.command(help=__doc__)
@click.option("--seed", default=0, show_default=True, help="of the rooms and of the boxes")
@click.option(
    "--json", "json_path", type=click.Path(path_type=Path), help="where the figures go; the pictures beside it"
)
@click.option("--quick", is_flag=True, help="fewer rooms, within 50 s")
@click.option(
    "--clouds",
    default=Path(__file__).resolve().parents[1].parent / "shared/data/mosd_learn",
    type=click.Path(path_type=Path),
    help="a folder of labelled clouds (PCD)",
)
@click.option(
    "--recording", type=click.Path(exists=True, path_type=Path), help="lay a recording's objects on each other"
)
@click.option("--model", default="", help="the detector's model for --recording")
def main(seed: int, json_path: Path | None, quick: bool, clouds: Path, recording: Path | None, model: str) -> None:
    if recording is not None:
        from object_layers import lay

        figures: dict[str, Any] = lay(recording, model, json_path)
    else:
        figures, results = measure(seed, clouds, quick)
        if json_path is not None:
            contact_sheet(results, json_path.with_suffix(".png"))
    text = json.dumps(figures, indent=2)
    click.echo(text)
    if json_path is not None:
        json_path.write_text(text + "\n")


if __name__ == "__main__":
    cv2.setNumThreads(1)
    os.environ["OMP_NUM_THREADS"] = "1"  # Open3D reads it when it is imported: one thread as ours
    main()
