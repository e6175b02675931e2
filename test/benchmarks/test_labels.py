# SPDX-License-Identifier: Apache-2.0
"""The judgement of labels on one frame that is known."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_tools.report.labels.labelled_pictures import LabelledPicture
from objreg_tools.report.labels.mapped_objects import MappedObject
from objreg_tools.report.labels.visible_part import VisiblePart
from objreg_tools.simulation.truth import TrueFrame, TrueObject, TrueSight
from objreg_tools.simulation.world.model import Symmetry

SHAPE = (100, 200)


def sight(instance: int, label: str, x_min: int) -> TrueSight:
    """An object that fills 40 by 20 px."""
    symmetry = Symmetry(axis=None, centre=None, turns=None)
    known = TrueObject(instance, label, False, np.ones(3), np.eye(4), symmetry)
    return TrueSight(known, np.float32([x_min, 10, x_min + 40, 30]), 1.0, 800, np.eye(4))


def part(label: str, x_min: int) -> VisiblePart:
    mask = np.ones((20, 40), bool)
    off = np.zeros(mask.shape)
    mapped = MappedObject(landmark=1, label=label, views=())
    return VisiblePart(object=mapped, mask=mask, corner=(x_min, 10), off=off, whole=800.0)


def test_labels_are_right_by_their_boxes_and_true_boxes_are_found_by_labels_and_detector() -> None:
    from labels import Tally, table

    frame = TrueFrame(0, 0, np.eye(4), (sight(1, "cup", 10), sight(2, "book", 100)))
    mask = np.zeros(SHAPE, np.uint16)
    mask[10:30, 10:50], mask[10:30, 100:140] = 1, 2
    parts = (part("cup", 20), part("thing", 60))  # the first is 10 px aside, the second on nothing
    tally = Tally()
    picture = LabelledPicture(0, np.zeros((*SHAPE, 3), np.uint8), parts)
    tally.add(picture, frame, mask, np.float32([[100, 10, 140, 30]]))
    found = tally.figures()
    assert found["iou_box"] == found["iou_mask"] == pytest.approx(0.6)  # 30 px of 50
    assert found["precision"] == {"all": 0.5, "named": 1.0, "thing": 0.0} and found["right_class"] == 1.0
    assert found["recall"] == 0.5 and found["recall_known"] == 1.0 and found["detector"] == 0.5
    assert "0.600" in table({"one": {"objects": 2, **found}})


def test_a_recording_without_labels_has_no_figures_but_what_was_missed() -> None:
    from labels import Tally

    frame = TrueFrame(0, 0, np.eye(4), (sight(1, "cup", 10),))
    tally = Tally()
    empty = LabelledPicture(0, np.zeros((*SHAPE, 3), np.uint8), ())
    tally.add(empty, frame, np.zeros(SHAPE, np.uint16), np.zeros((0, 4), np.float32))
    found = tally.figures()
    assert found["iou_box"] is None and found["precision"]["all"] is None and found["recall"] == 0.0
