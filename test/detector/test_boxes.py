# SPDX-License-Identifier: Apache-2.0
"""Overlap, suppression and decoding of boxes."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.detector.boxes import clip, decode, iou, suppress


def greedy(xyxy: np.ndarray, classes: np.ndarray, same: float, cross: float) -> list[bool]:
    """Greedy suppression as everybody writes it, one box after the other."""
    kept: list[int] = []
    for i in range(len(xyxy)):
        limits = [same if classes[i] == classes[j] else cross for j in kept]
        overlaps = [iou(xyxy[i : i + 1], xyxy[j : j + 1])[0, 0] for j in kept]
        if all(overlap <= limit for overlap, limit in zip(overlaps, limits, strict=True)):
            kept.append(i)
    return [i in kept for i in range(len(xyxy))]


def test_the_overlap_of_half_shifted_boxes_is_one_third() -> None:
    a = np.array([[0, 0, 2, 2]], np.float32)
    b = np.array([[1, 0, 3, 2], [5, 5, 6, 6], [0, 0, 2, 2]], np.float32)
    assert iou(a, b)[0] == pytest.approx([1 / 3, 0, 1])


def test_empty_boxes_do_not_overlap_themselves() -> None:
    a = np.array([[1, 1, 1, 1]], np.float32)
    assert iou(a, a)[0, 0] == 0


def test_suppression_equals_the_greedy_loop() -> None:
    rng = np.random.default_rng(3)
    for size in (0, 1, 7, 60):
        low = rng.uniform(0, 50, (size, 2))
        xyxy = np.concatenate([low, low + rng.uniform(5, 60, (size, 2))], axis=1)
        classes = rng.integers(0, 3, size)
        assert suppress(xyxy, classes, 0.3, 0.6).tolist() == greedy(xyxy, classes, 0.3, 0.6)


def test_a_suppressed_box_suppresses_nothing() -> None:
    xyxy = np.array([[0, 0, 10, 10], [4, 0, 14, 10], [8, 0, 18, 10]], float)
    assert suppress(xyxy, np.zeros(3, int), 0.4, 1.0).tolist() == [True, False, True]


def test_boxes_of_other_labels_stay_until_they_are_nearly_the_same() -> None:
    xyxy = np.array([[0, 0, 10, 10], [0, 0, 10, 9.5], [0, 0, 10, 7]], float)
    assert suppress(xyxy, np.array([0, 1, 2]), 0.5, 0.9).tolist() == [True, False, True]


def test_zero_offsets_decode_to_the_prior() -> None:
    prior = np.array([[0.5, 0.4, 0.2, 0.1]], np.float32)
    variances = np.array([0.1, 0.1, 0.2, 0.2], np.float32)
    assert decode(np.zeros((1, 4), np.float32), prior, variances)[0] == pytest.approx([0.4, 0.35, 0.6, 0.45])
    offsets = np.array([[1, 2, np.log(2) / 0.2, 0]], np.float32)
    assert decode(offsets, prior, variances)[0] == pytest.approx([0.32, 0.37, 0.72, 0.47], abs=1e-6)


def test_boxes_are_cut_to_the_image() -> None:
    xyxy = np.array([[-5, 3, 700, 500]], np.float32)
    assert clip(xyxy, 480, 640).tolist() == [[0, 3, 640, 480]]
