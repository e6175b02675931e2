# SPDX-License-Identifier: Apache-2.0
"""Matched and moved objects, and who proposed their pose."""

from __future__ import annotations

import pytest

from objreg_ros.data import Reason
from objreg_ros.registration.candidate import ObjectPair
from objreg_ros.registration.gate import objects
from objreg_ros.registration.gate.verdict import refuse
from registration.samples import candidate

LIMITS = objects.Limits(many=3, proposers=2, silhouette_score=0.0)


def test_proposers_of_the_same_evidence_are_one() -> None:
    assert objects.independent(("centroids", "objects", "odometry")) == 1
    assert objects.independent(("features", "objects")) == 2 and objects.independent(()) == 0


@pytest.mark.parametrize(
    ("matched", "few_proposers", "inconsistent", "lone", "doubtful", "uncertain"),
    [
        (1, True, False, True, True, False),
        (1, False, False, False, True, False),
        (2, True, False, False, False, True),
        (2, False, False, False, False, False),
        (2, False, True, False, True, True),
        (3, True, False, False, False, False),
    ],
)
def test_what_objects_are_worth_depends_on_their_number_their_proposers_and_their_silhouettes(
    matched: int, few_proposers: bool, inconsistent: bool, lone: bool, doubtful: bool, uncertain: bool
) -> None:
    one = candidate(
        matched=tuple(ObjectPair(k, k, "cup") for k in range(matched)),
        agreeing_proposers=("objects",) if few_proposers else ("features", "objects"),
        silhouette_score_nearby=-0.1 if inconsistent else 0.1,
    )
    found = objects.objects_of(one, LIMITS)
    assert found == (matched, matched < 3, few_proposers, inconsistent)
    assert (found.lone, found.doubtful, found.uncertain) == (lone, doubtful, uncertain)


def test_only_several_objects_are_inconsistent_and_only_where_silhouettes_are_known() -> None:
    assert objects.are_inconsistent(2, -0.1, 0.0)
    assert not (objects.are_inconsistent(1, -0.1, 0.0) or objects.are_inconsistent(2, None, 0.0))


def test_more_moved_than_matched_objects_refuse_and_so_does_none() -> None:
    assert objects.check_moved(1, 1) is None and objects.check_matched(1) is None
    assert objects.check_moved(1, 2) == (Reason.MOVED, "2 objects moved, 1 stayed")
    assert objects.check_matched(0) == (Reason.FEW_OBJECTS, "0 objects < 1")


def test_a_moved_object_is_outvoted_by_those_that_stayed() -> None:
    assert refuse(candidate(moved=(ObjectPair(2, 2, "bottle"),))) is None
