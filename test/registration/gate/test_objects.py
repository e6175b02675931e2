# SPDX-License-Identifier: Apache-2.0
"""Matched and moved objects, and who proposed their pose."""

from __future__ import annotations

import pytest

from objreg_ros.data import Reason
from objreg_ros.registration.gate import objects
from objreg_ros.registration.gate.verdict import refuse
from registration.gate.samples import CUP
from registration.samples import candidate


def test_proposers_of_the_same_evidence_are_one() -> None:
    assert objects.independent(("centroids", "objects", "odometry")) == 1
    assert objects.independent(("features", "objects")) == 2 and objects.independent(()) == 0


@pytest.mark.parametrize(
    ("matched", "proposers", "lone"),
    [(1, ("objects",), True), (1, ("features", "objects"), False), (2, ("objects",), False)],
)
def test_one_object_is_lone_unless_two_proposers_came_to_its_pose(
    matched: int, proposers: tuple[str, ...], lone: bool
) -> None:
    assert objects.is_lone(candidate(matched=(CUP,) * matched, agreeing_proposers=proposers)) is lone


def test_no_more_objects_may_have_moved_than_stayed() -> None:
    assert objects.check_moved(2, 2) is None
    assert objects.check_moved(1, 2) == (Reason.MOVED, "2 objects moved, 1 stayed")
    refusal = refuse(candidate(matched=(CUP,), moved=(CUP, CUP)))
    assert refusal is not None and refusal[0] is Reason.MOVED


def test_a_pose_without_a_matched_object_is_refused_however_well_the_views_agree() -> None:
    assert objects.check_matched(1) is None
    refusal = refuse(candidate(matched=()))
    assert refusal is not None and refusal == (Reason.FEW_OBJECTS, "0 objects < 1")
