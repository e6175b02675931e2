# SPDX-License-Identifier: Apache-2.0
"""Matched and moved objects, and who proposed their pose."""

from __future__ import annotations

import pytest

from objreg_ros.data.closures import Reason
from objreg_ros.data.frames import UNNAMED
from objreg_ros.registration.candidate import ObjectPair
from objreg_ros.registration.gate import objects
from objreg_ros.registration.gate.verdict import refuse
from registration.gate.samples import CUP
from registration.samples import candidate

THING = ObjectPair(0, 0, UNNAMED)


def test_proposers_of_the_same_evidence_are_one() -> None:
    assert objects.independent(("centroids", "objects", "odometry")) == 1
    assert objects.independent(("features", "objects")) == 2 and objects.independent(()) == 0


@pytest.mark.parametrize(("matched", "lone"), [((CUP,), True), ((CUP, THING), True), ((CUP, CUP), False)])
def test_one_object_is_lone_with_a_thing_beside_it_too(matched: tuple[ObjectPair, ...], lone: bool) -> None:
    assert objects.is_lone(matched) is lone


def test_no_more_objects_may_have_moved_than_stayed() -> None:
    assert objects.check_moved(2, 2) is None
    assert objects.check_moved(1, 2) == (Reason.MOVED, "2 objects moved, 1 stayed")
    refusal = refuse(candidate(matched=(CUP,), moved=(CUP, CUP)))
    assert refusal is not None and refusal[0] is Reason.MOVED


def test_a_pose_without_a_matched_object_is_refused_however_well_the_views_agree() -> None:
    assert objects.check_matched((CUP,)) is None
    refusal = refuse(candidate(matched=()))
    assert refusal is not None and refusal == (Reason.FEW_OBJECTS, "0 objects < 1")


def test_objects_without_a_name_need_one_with_a_name_or_two_more_of_them() -> None:
    assert objects.check_matched((THING, CUP)) is None and objects.check_matched((THING,) * 3) is None
    refusal = refuse(candidate(matched=(THING,) * 2))
    assert refusal == (Reason.FEW_OBJECTS, "0 objects < 1, 2 without a name < 3")


def test_objects_without_a_name_count_for_half() -> None:
    assert objects.counted((THING, CUP)) == 1.5 and objects.counted((THING,) * 3) == 1.5 and objects.counted(()) == 0
    assert refuse(candidate(matched=(CUP,), moved=(THING, THING))) is None
