# SPDX-License-Identifier: Apache-2.0
"""What the views say without the few objects that fill them."""

from __future__ import annotations

from dataclasses import replace

import pytest

from objreg_ros.data.closures import Reason
from objreg_ros.registration.candidate import ObjectPair, Verification
from objreg_ros.registration.gate import surroundings
from objreg_ros.registration.gate.limits import LIMITS as GATE
from objreg_ros.registration.gate.verdict import refuse
from registration.gate.samples import CUP
from registration.samples import candidate

LIMITS = surroundings.SurroundingsLimits(tested=600, inliers=0.35, correlation_loss=0.25, score=0.25)
SEEN = Verification(inliers=0.9, violations=0.0, occluded=0.0, correlation=0.6, tested=9000, score=0.8)


@pytest.mark.parametrize(
    ("around", "reason"),
    [
        ({}, None),
        ({"score": 0.24}, Reason.LOW_OVERLAP),
        ({"tested": 599}, Reason.LOW_OVERLAP),
        ({"inliers": 0.3}, Reason.LOW_OVERLAP),
        ({"correlation": 0.34}, Reason.TEXTURE),
        ({"correlation": None}, None),
    ],
)
def test_surroundings_are_asked_for_what_whole_views_are(around: dict[str, float], reason: Reason | None) -> None:
    refusal = surroundings.check(replace(SEEN, **around), SEEN, ["cup", "book"], True, LIMITS)
    assert (None if refusal is None else refusal[0]) is reason
    assert refusal is None or refusal[1].startswith("without the cup and the book ")


def test_surroundings_that_were_not_looked_at_refuse_nothing() -> None:
    assert surroundings.check(None, SEEN, [], True, LIMITS) is None


def test_only_around_a_lone_object_must_the_views_score() -> None:
    around = replace(SEEN, score=0.24)
    assert surroundings.check(around, SEEN, ["cup", "book"], False, LIMITS) is None
    refusal = surroundings.check(around, SEEN, ["cup"], True, LIMITS)
    assert refusal == (Reason.LOW_OVERLAP, "without the cup view score 0.24 < 0.25")


@pytest.mark.parametrize(
    ("around", "reason"),
    [
        ({"correlation": -0.1}, Reason.TEXTURE),
        ({"inliers": 0.5 * GATE.surroundings.inliers}, Reason.LOW_OVERLAP),
        ({"tested": GATE.surroundings.tested - 1}, Reason.LOW_OVERLAP),
        ({}, None),
    ],
)
@pytest.mark.parametrize("matched", [(CUP,), (CUP, ObjectPair(1, 1, "book"))], ids=len)
def test_what_is_around_few_objects_must_agree_by_itself(
    around: dict[str, float], reason: Reason | None, matched: tuple[ObjectPair, ...]
) -> None:
    few = candidate(matched=matched, score_margin=1.0, surroundings=replace(candidate().verification, **around))
    refusal = refuse(few)
    assert (None if refusal is None else refusal[0]) is reason
    assert refusal is None or refusal[1].startswith(
        ("without the cup ", "without the cup and the book ")[len(matched) - 1]
    )


@pytest.mark.parametrize("proposers", [("features", "objects"), ("objects",)], ids=len)
@pytest.mark.parametrize("matched", [(CUP,), (CUP, ObjectPair(1, 1, "book"))], ids=len)
def test_few_objects_around_which_the_print_agrees_much_less_have_moved(
    matched: tuple[ObjectPair, ...], proposers: tuple[str, ...]
) -> None:
    def judged(around: float | None, whole: float | None = 0.6) -> object:
        seen = replace(candidate().verification, correlation=whole)
        evidence = {
            "matched": matched,
            "agreeing_proposers": proposers,
            "score_margin": 1.0,
            "yaw_known": True,
            "silhouette_score": 0.9,
        }
        surroundings = replace(seen, correlation=around)
        return refuse(candidate(**evidence, correlation=whole, perturbation_margin=1.0, surroundings=surroundings))

    assert judged(0.6 - 0.9 * GATE.surroundings.correlation_loss) is None
    assert judged(0.99) is None
    assert judged(None) is None and judged(None, None) is None
    refusal = judged(0.6 - 1.1 * GATE.surroundings.correlation_loss)
    assert isinstance(refusal, tuple) and refusal[0] is Reason.TEXTURE and "without the cup" in refusal[1]


@pytest.mark.parametrize("proposers", [("features", "objects"), ("objects",)], ids=len)
def test_a_lone_object_whose_surroundings_score_little_has_moved_whoever_proposed_it(
    proposers: tuple[str, ...],
) -> None:
    def judged(score: float, *matched: ObjectPair) -> object:
        around = replace(candidate().verification, score=score)
        evidence = {"score_margin": 1.0, "perturbation_margin": 1.0, "yaw_known": True}
        return refuse(candidate(matched=matched, agreeing_proposers=proposers, surroundings=around, **evidence))

    least = GATE.surroundings.score
    assert judged(least + 0.01, CUP) is None and judged(least - 0.01, CUP, CUP) is None
    refusal = judged(least - 0.01, CUP)
    assert isinstance(refusal, tuple) and refusal[0] is Reason.LOW_OVERLAP and "without the cup" in refusal[1]
