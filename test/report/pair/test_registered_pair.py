# SPDX-License-Identifier: Apache-2.0
"""Two views of a place whose poses are known, registered with all their steps."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from registration.rooms import keyframe, seen_from

from objreg_ros.geometry import inverse
from objreg_ros.registration import align
from objreg_ros.registration.params import RegistrationParams
from objreg_tools.report.pair.registered_pair import ACCEPTED, RegisteredPair, register_pair

FIRST, SECOND = keyframe(seen_from(0.0), seed=1), keyframe(seen_from(20.0), seed=2)
T_TRUE = inverse(seen_from(0.0)) @ seen_from(20.0)


@pytest.fixture(scope="module")
def found() -> RegisteredPair:
    return register_pair(FIRST, SECOND, RegistrationParams(), T_TRUE)


def test_the_verdict_and_the_pose_are_those_of_a_registration(found: RegisteredPair) -> None:
    registration = align(SECOND, FIRST)
    assert registration.accepted and found.summary["accepted"] and found.summary["reason"] == ACCEPTED
    np.testing.assert_array_equal(found.summary["T_1_2"], registration.T_target_source)
    assert found.summary["odds"]["odds"] == pytest.approx(registration.evidence["odds"])


def test_the_terms_of_the_odds_add_up_to_their_sum(found: RegisteredPair) -> None:
    odds = found.summary["odds"]
    total = odds["prior"] + sum(term["weight"] for term in odds["terms"])
    assert total == pytest.approx(odds["sum"], abs=1e-3) and 10.0 ** odds["sum"] == pytest.approx(
        odds["odds"], rel=1e-3
    )


def test_the_true_error_is_that_of_the_pose(found: RegisteredPair) -> None:
    assert found.summary["error"]["rotation_deg"] < 1.0 and found.summary["error"]["translation_cm"] < 2.0
    assert found.summary["truth"]["rotation_deg"] == pytest.approx(20.0, abs=5.0)


def test_each_candidate_has_its_end_and_one_is_accepted(found: RegisteredPair) -> None:
    ends = [row["became"] for row in found.summary["candidates"]]
    assert all(ends) and ends.count(ACCEPTED) == 1
    assert sum(row["finished"] for row in found.summary["hypotheses"]) >= 1


def test_both_frames_have_their_objects_and_features(found: RegisteredPair) -> None:
    for frame in found.summary["frames"]:
        assert {"cup", "bottle"} <= {item["label"] for item in frame["objects"]}
        assert frame["features"] > 0 and frame["keypoints"] > 0
    assert json.loads(json.dumps(found.summary)) == found.summary


def test_a_refused_pair_has_its_reason_and_no_pose() -> None:
    strict = register_pair(FIRST, SECOND, RegistrationParams(least_odds=1e6))
    assert not strict.summary["accepted"] and strict.summary["T_1_2"] is None and strict.candidate is not None
    assert strict.summary["error"] is None and "odds" in strict.summary["detail"]


def test_a_frame_without_points_proposes_nothing() -> None:
    view = replace(SECOND.view, xyz=np.full_like(SECOND.view.xyz, np.nan))
    nothing = replace(
        SECOND,
        objects=(),
        view=view,
        context=replace(SECOND.context, xyz=SECOND.context.xyz[:0], normals=SECOND.context.normals[:0]),
    )
    empty = register_pair(FIRST, nothing, RegistrationParams())
    assert empty.summary["reason"] == "no_hypothesis" and empty.summary["candidates"] == []
    assert empty.candidate is None and empty.matches is None and empty.summary["odds"] is None


def test_the_steps_of_another_method_are_not_shown() -> None:
    with pytest.raises(ValueError, match="expected objreg, whose steps are shown here, got paper"):
        register_pair(FIRST, SECOND, RegistrationParams(method="paper"))
