# SPDX-License-Identifier: Apache-2.0
"""Assignment, decoding and the loss."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from objreg_ros.detector import boxes as detector_boxes
from training.labels import LABELS
from training.multibox import (
    ANSWERS,
    DIFFICULT,
    WANTED,
    Assignment,
    MultiboxLoss,
    assign,
    decode,
    generalised_iou,
)
from training.priors import INPUT_HW, VARIANCES, make_priors

CLASSES = 9
PRIORS = torch.from_numpy(make_priors()) * torch.tensor([INPUT_HW[1], INPUT_HW[0]] * 2)
LOSS = MultiboxLoss(PRIORS, torch.tensor(VARIANCES))
START = decode(torch.zeros(1, len(PRIORS), 4), PRIORS, torch.tensor(VARIANCES))
SCORES = torch.full((1, len(PRIORS), CLASSES), 0.02)


def truth(*rows: tuple[float, ...]) -> torch.Tensor:
    """One picture's truth with a row of padding."""
    return torch.tensor([[*rows, (0.0,) * 6]])


def assigned(*rows: tuple[float, ...]) -> Assignment:
    return assign(SCORES, START, PRIORS[:, :2], truth(*rows))


def offsets(box: tuple[float, ...]) -> torch.Tensor:
    """The output with which every prior says ``box``."""
    low, high = torch.tensor(box[:2]), torch.tensor(box[2:])
    centre = ((low + high) / 2 - PRIORS[:, :2]) / PRIORS[:, 2:] / 0.1
    return torch.cat([centre, torch.log((high - low) / PRIORS[:, 2:]) / 0.2], dim=1)[None]


def test_training_and_detector_decode_alike() -> None:
    loc = np.random.default_rng(0).normal(size=(len(PRIORS), 4)).astype(np.float32)
    ours = decode(torch.from_numpy(loc)[None], PRIORS, torch.tensor(VARIANCES))[0].numpy()
    theirs = detector_boxes.decode(loc, PRIORS.numpy(), np.array(VARIANCES, np.float32))
    assert ours == pytest.approx(theirs, abs=1e-2)


def test_generalised_iou_is_one_for_the_same_box_and_negative_for_boxes_apart() -> None:
    a, b = torch.tensor([0.0, 0.0, 10.0, 10.0]), torch.tensor([90.0, 0.0, 100.0, 10.0])
    assert float(generalised_iou(a, a)) == pytest.approx(1.0)
    assert float(generalised_iou(a, b)) == pytest.approx(-0.8)


def test_an_object_is_answered_for_by_a_few_priors_inside_of_it() -> None:
    found = assigned((101, 99, 163, 158, 3, WANTED))
    rows = torch.nonzero(found.alignment[0]).flatten()
    assert 1 <= len(rows) <= ANSWERS and (found.classes[0, rows] == 3).all()
    assert ((PRIORS[rows, :2] > 99) & (PRIORS[rows, :2] < 163)).all()


def test_even_a_thin_object_has_a_prior() -> None:
    assert (assigned((100, 201, 160, 204, 6, WANTED)).alignment > 0).any()


def test_a_difficult_object_is_neither_positive_nor_negative() -> None:
    found = assigned((100, 100, 200, 200, 2, DIFFICULT))
    assert not found.alignment.any()
    assert not found.counted.all() and found.counted.float().mean() > 0.9


def test_padding_is_all_background() -> None:
    found = assigned()
    assert not found.alignment.any() and found.counted.all()


def test_the_right_answer_costs_less_than_the_wrong_one() -> None:
    box = (100.0, 100.0, 160.0, 160.0)
    known = truth((*box, 3, WANTED))
    chosen = assign(SCORES, decode(offsets(box), PRIORS, torch.tensor(VARIANCES)), PRIORS[:, :2], known).alignment > 0
    right, wrong = (torch.full((1, len(PRIORS), CLASSES), -10.0) for _ in range(2))
    right[0, chosen[0], 3], wrong[0, chosen[0], 4] = 10.0, 10.0
    assert float(LOSS(offsets(box), right, known)[0]) == pytest.approx(0.0, abs=1e-3)
    assert float(LOSS(offsets(box), right, known)[1]) < 0.1
    assert float(LOSS(offsets(box), wrong, known)[1]) > 5


def test_a_wrong_flashlight_costs_twice_as_much_as_a_wrong_cap() -> None:
    cost = {}
    for label in ("cap", "flashlight"):
        said = torch.full((1, len(PRIORS), CLASSES), -30.0)
        said[0, 0, LABELS.index(label)] = 10.0
        cost[label] = float(LOSS(torch.zeros(1, len(PRIORS), 4), said, truth())[1])
    assert cost["flashlight"] == pytest.approx(2 * cost["cap"], rel=1e-3)
