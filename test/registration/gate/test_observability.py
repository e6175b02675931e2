# SPDX-License-Identifier: Apache-2.0
"""Whether surfaces and views hold a pose."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.data import Reason
from objreg_ros.registration.candidate import ObjectPair
from objreg_ros.registration.gate import observability
from objreg_ros.registration.gate.limits import LIMITS as GATE
from objreg_ros.registration.gate.verdict import refuse
from registration.gate.samples import lone
from registration.samples import candidate, moved

LIMITS = observability.Limits(
    sigma_m=0.03, range_m=2.5, least_margin=0.1, firm_margin=0.4, uncertain_factor=1.5, perturbation_m=0.15
)


@pytest.mark.parametrize(
    ("sigma_m", "range_m", "uncertain", "least"),
    [
        (0.01, 1.0, False, 0.1),
        (0.045, 1.0, False, 0.225),
        (0.01, 3.75, False, 0.225),
        (0.045, 5.0, False, 0.4),
        (9.0, 1.0, False, 0.4),
        (0.01, 1.0, True, 0.15),
    ],
)
def test_the_least_margin_grows_with_variance_and_distance_up_to_the_firm_one(
    sigma_m: float, range_m: float, uncertain: bool, least: float
) -> None:
    assert observability.least_margin(sigma_m, range_m, uncertain, LIMITS) == pytest.approx(least)


def test_a_pose_is_held_by_its_surfaces_or_by_its_views() -> None:
    assert observability.check(0.03, None, 0.1, LIMITS) is None and observability.check(9.0, 0.1, 0.1, LIMITS) is None
    assert observability.check(0.031, None, 0.1, LIMITS) == (Reason.SLACK, "sigma 0.031 m > 0.030 m, not pushed")
    assert observability.check(0.01, 0.09, 0.1, LIMITS) == (
        Reason.SLACK,
        "sigma 0.010 m, V falls by 0.09 < 0.10 over 0.15 m",
    )


def test_an_unobservable_direction_refuses() -> None:
    assert observability.check_directions(0) is None
    assert observability.check_directions(2) == (Reason.SLACK, "2 of 6 directions held by nothing")


def test_the_range_is_the_mean_of_both_cameras() -> None:
    assert observability.mean_range(np.array([0.0, 0.0, 2.0]), moved(0.0, 0.0, 1.0)) == pytest.approx(1.5)


def systematic_depth_error_of_step(sigma: float) -> dict[str, object]:
    """The evidence of a position that a systematic depth error leaves as badly known as that."""
    return {"systematic_depth_error": np.diag([sigma**2, 0, 0, 0, 0, 0])}


def test_two_objects_that_one_proposer_brought_together_leave_more_to_a_perturbation() -> None:
    two, three = (tuple(ObjectPair(k, k, "cup") for k in range(n)) for n in (2, 3))
    short = GATE.observability.least_margin * (0.5 + 0.5 * GATE.observability.uncertain_factor)
    for matched, proposers, accepted in (
        (two, ("objects",), False),
        (two, ("objects", "odometry"), False),
        (two, ("centroids", "features"), True),
        (three, ("objects",), True),
    ):
        refusal = refuse(candidate(matched=matched, agreeing_proposers=proposers, perturbation_margin=short))
        assert (refusal is None) is accepted, (matched, proposers, refusal)
        assert refusal is None or refusal[0] is Reason.SLACK


def test_a_pose_that_a_warped_depth_would_move_far_is_refused_as_sliding() -> None:
    kept, refused = (
        refuse(candidate(**systematic_depth_error_of_step(GATE.observability.sigma_m * share))) for share in (0.9, 1.1)
    )
    assert kept is None
    assert refused is not None and refused[0] is Reason.SLACK


def test_the_worse_the_surfaces_hold_a_pose_the_more_the_views_must() -> None:
    loose = systematic_depth_error_of_step(1.5 * GATE.observability.sigma_m)
    least = 2.25 * GATE.observability.least_margin
    assert refuse(candidate(**loose, perturbation_margin=least + 0.01)) is None
    assert refuse(candidate(**loose, perturbation_margin=least - 0.01)) is not None


@pytest.mark.parametrize("eye", [0.0, 0.4])
def test_the_farther_away_what_is_seen_the_more_the_views_must_hold_it(eye: float) -> None:
    """Far from both cameras in the mean: the other one stands ``eye`` nearer."""
    for share, least in ((0.9, 1.0), (1.0, 1.0), (1.4, 1.96)):
        middle = np.array([0.0, 0.0, share * GATE.observability.range_m + eye / 2.0])
        seen = {"T": moved(0.0, 0.0, eye), "middle": middle}
        assert refuse(candidate(**seen, perturbation_margin=1.01 * least * GATE.observability.least_margin)) is None
        refusal = refuse(candidate(**seen, perturbation_margin=0.99 * least * GATE.observability.least_margin))
        assert refusal is not None and refusal[0] is Reason.SLACK
    assert refuse(candidate(middle=np.array([0.0, 0.0, 1.4 * GATE.observability.range_m]))) is None  # not perturbed


def test_of_distance_and_what_surfaces_know_the_worse_counts() -> None:
    far = {
        "middle": np.array([0.0, 0.0, 1.2 * GATE.observability.range_m]),
        **systematic_depth_error_of_step(1.5 * GATE.observability.sigma_m),
    }
    assert refuse(candidate(**far, perturbation_margin=2.3 * GATE.observability.least_margin)) is None
    assert refuse(candidate(**far, perturbation_margin=2.2 * GATE.observability.least_margin)) is not None
    far["middle"] = np.array([0.0, 0.0, 1.6 * GATE.observability.range_m])
    assert refuse(candidate(**far, perturbation_margin=2.5 * GATE.observability.least_margin)) is not None


def test_several_objects_that_look_otherwise_leave_more_to_the_views() -> None:
    least = GATE.observability.least_margin
    several = {"matched": (ObjectPair(0, 0, "cup"), ObjectPair(1, 1, "book")), "perturbation_margin": 1.2 * least}
    assert refuse(candidate(**several, silhouette_score=0.1)) is None
    refusal = refuse(candidate(**several, silhouette_score=-0.1))
    assert refusal is not None and refusal[0] is Reason.SLACK
    assert refuse(candidate(**{**several, "perturbation_margin": 2.0 * least}, silhouette_score=-0.1)) is None


def test_several_objects_may_be_what_they_are_a_little_aside_and_a_lone_one_may_not() -> None:
    aside = {"silhouette_score": -1.0, "perturbation_margin": 1.2 * GATE.observability.least_margin}
    assert refuse(candidate(**aside, silhouette_score_nearby=0.1)) is None
    assert refuse(candidate(**aside)) is not None
    assert refuse(lone(silhouette_score=-1.0, silhouette_score_nearby=0.1)) is not None


def test_a_pose_that_the_views_hold_firmly_is_known_however_badly_the_surfaces_know_it() -> None:
    badly, firm = systematic_depth_error_of_step(10.0 * GATE.observability.sigma_m), GATE.observability.firm_margin
    assert refuse(candidate(**badly, perturbation_margin=firm + 0.01)) is None
    refusal = refuse(candidate(**badly, perturbation_margin=firm - 0.01))
    assert refusal is not None and refusal[0] is Reason.SLACK


@pytest.mark.parametrize("direction", [0, 5])
def test_a_direction_that_nothing_holds_is_refused_however_firmly_the_rest_is_held(direction: int) -> None:
    firm = {"perturbation_margin": 2.0 * GATE.observability.firm_margin, "score": 1.0}
    assert refuse(candidate(**firm)) is None
    refusal = refuse(candidate(**firm, degenerate=np.eye(6)[direction : direction + 1]))
    assert refusal is not None and refusal[0] is Reason.SLACK
    assert "1 of 6" in refusal[1]
