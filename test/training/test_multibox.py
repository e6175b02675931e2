# SPDX-License-Identifier: Apache-2.0
"""Matching, encoding and the loss."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs torch")

from objreg_ros.detector.boxes import decode  # noqa: E402
from training.multibox import NEITHER, Matcher, encode, multibox_loss  # noqa: E402
from training.priors import VARIANCES, make_priors  # noqa: E402

MATCHER = Matcher(torch.from_numpy(make_priors()), torch.tensor(VARIANCES))


def test_what_is_encoded_for_training_is_decoded_by_the_detector() -> None:
    priors = make_priors()[:50]
    boxes = np.tile(np.array([[0.1, 0.2, 0.4, 0.5]], np.float32), (50, 1))
    offsets = encode(torch.from_numpy(boxes), torch.from_numpy(priors), torch.tensor(VARIANCES)).numpy()
    near = np.abs(offsets[:, 2:]).max(axis=1) < 4 / 0.2
    assert decode(offsets, priors, np.array(VARIANCES, np.float32))[near] == pytest.approx(boxes[near], abs=1e-5)


def test_every_object_has_a_prior_even_where_none_fits() -> None:
    thin = torch.tensor([[0.30, 0.50, 0.70, 0.52]])
    target, _ = MATCHER(thin, torch.tensor([7]), torch.tensor([False]))
    assert (target == 8).sum() >= 1


def test_priors_of_difficult_objects_are_neither_positive_nor_negative() -> None:
    box = torch.tensor([[0.3, 0.3, 0.6, 0.6]])
    target, _ = MATCHER(box, torch.tensor([2]), torch.tensor([True]))
    assert (target == NEITHER).sum() > 0 and (target > 0).sum() == 0


def test_a_picture_without_objects_is_all_background() -> None:
    target, _ = MATCHER(torch.zeros(0, 4), torch.zeros(0, dtype=torch.int64), torch.zeros(0, dtype=torch.bool))
    assert (target == 0).all()


def test_the_right_answer_costs_less_than_the_wrong_one() -> None:
    target, offsets = MATCHER(torch.tensor([[0.3, 0.3, 0.6, 0.6]]), torch.tensor([2]), torch.tensor([False]))
    right = torch.nn.functional.one_hot(target.clamp(min=0), 10).float()[None] * 10
    wrong = torch.nn.functional.one_hot((target.clamp(min=0) + 1) % 10, 10).float()[None] * 10
    location, confidence = multibox_loss(offsets[None], right, target[None], offsets[None])
    assert float(location) == 0 and float(confidence) < 0.01
    assert float(multibox_loss(offsets[None] + 1, wrong, target[None], offsets[None])[1]) > 5
