# SPDX-License-Identifier: Apache-2.0
"""Average precision of a detector against known boxes (Everingham et al., "The PASCAL VOC Challenge", 2010), with the
area under the whole interpolated curve, as VOC since 2010 and COCO take it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import Detections
from objreg_ros.detector.boxes import area, iou

LEAST_IOU = 0.5  # of a detection and the box that it finds


@dataclass(frozen=True)
class TrueBoxes:
    """What is in one image: ``xyxy (N, 4) float32`` pixels, N names, and ``difficult (N,) bool``.

    A difficult box need not be found, and finding it is no error.
    """

    xyxy: Array
    label: tuple[str, ...]
    difficult: Array


def average_precision(
    seen: Sequence[Detections], truth: Sequence[TrueBoxes], label: str, least_area: float = 0.0
) -> float | None:
    """The average precision 0..1 of one label over a set of images; None when no image has the label to be found.

    Every box of ``truth`` is found at most once, by the best scored detection that overlaps it by `LEAST_IOU`.
    A detection that finds nothing is no error where it is smaller than ``least_area`` px^2, as COCO counts it when only
    larger objects are asked for.
    """
    wanted = sum(_wanted(known, label) for known in truth)
    if wanted == 0:
        return None
    rows = [_judge(one, known, label, least_area) for one, known in zip(seen, truth, strict=True)]
    score, verdict = (np.concatenate(part) for part in zip(*rows, strict=True))
    counted = verdict >= 0
    right = verdict[counted][np.argsort(-score[counted], kind="stable")]
    found = np.cumsum(right)
    return _area(found / wanted, found / np.arange(1, len(right) + 1))


def _wanted(known: TrueBoxes, label: str) -> int:
    of_label = np.array([name == label for name in known.label], bool)
    return int((of_label & ~known.difficult).sum())


def _judge(seen: Detections, known: TrueBoxes, label: str, least_area: float) -> tuple[Array, Array]:
    """Scores and verdicts (1 right, 0 wrong, -1 not counted) of the detections of ``label`` in one image."""
    mine = np.flatnonzero([name == label for name in seen.label])
    true = np.flatnonzero([name == label for name in known.label])
    difficult = known.difficult[true]
    overlap = iou(seen.xyxy[mine], known.xyxy[true])
    free, small = ~difficult, area(seen.xyxy[mine]) < least_area
    verdict = np.zeros(len(mine), int)
    for row in np.argsort(-seen.score[mine], kind="stable"):
        candidates = np.where(free & (overlap[row] >= LEAST_IOU), overlap[row], -1)
        if candidates.max(initial=-1) >= 0:
            free[candidates.argmax()] = False
            verdict[row] = 1
        elif (overlap[row][difficult] >= LEAST_IOU).any() or small[row]:
            verdict[row] = -1
    return seen.score[mine].astype(float), verdict


def _area(recall: Array, precision: Array) -> float:
    """The area under precision over recall, precision made monotone from the right."""
    envelope = np.maximum.accumulate(precision[::-1])[::-1]
    return float((np.diff(recall, prepend=0.0) * envelope).sum())
