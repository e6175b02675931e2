# SPDX-License-Identifier: Apache-2.0
"""The page of a pair: it holds what its JSON has, and opens without a network."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from markupsafe import escape
from registration.rooms import CAMERA, cast, keyframe, seen_from

from objreg_ros.data.images import DepthImage, Detections
from objreg_ros.registration.gate.kinds import KINDS
from objreg_ros.registration.gate.likelihood import BEFORE
from objreg_ros.registration.params import RegistrationParams
from objreg_ros.registration.score.keypoint_agreement import agreeing
from objreg_tools.report.closures.matched_features import MOST
from objreg_tools.report.closures.weighed_evidence import EVIDENCE, with_unit
from objreg_tools.report.pair.pair_page import Seen, pair_page
from objreg_tools.report.pair.registered_pair import RegisteredPair, register_pair

NAME = "<kitchen>"


@pytest.fixture(scope="module")
def found() -> RegisteredPair:
    return register_pair(keyframe(seen_from(0.0), seed=1), keyframe(seen_from(20.0), seed=2), RegistrationParams())


def seen(angle: float) -> Seen:
    depth = np.nan_to_num(cast(seen_from(angle))[0], posinf=0.0).astype(np.float32)
    rgb = np.full((*depth.shape, 3), 120, np.uint8)
    box = Detections(
        xyxy=np.array([[20, 20, 60, 60]], np.float32),
        score=np.array([0.5], np.float32),
        label=("cup",),
        image_hw=depth.shape,
        stamp_ns=0,
    )
    return Seen(DepthImage(depth=depth, rgb=rgb, intrinsics=CAMERA, stamp_ns=0), box)


def text(found: RegisteredPair, *pictures: Seen | None) -> str:
    return pair_page(NAME, {"start_ns": 0, **found.summary}, found, pictures)


def test_a_page_has_both_pictures_the_overlay_and_the_matches(found: RegisteredPair) -> None:
    page = text(found, seen(0.0), seen(20.0))
    assert page.count("data:image/webp") == 5 and "http" not in page.replace("http://www.w3.org", "")
    assert "&lt;kitchen&gt;, one pair" in page and NAME not in page
    assert all(escape(term["phrase"]) in page for term in found.summary["odds"]["terms"])


def test_evidence_has_the_names_and_the_units_that_the_page_of_a_run_has(found: RegisteredPair) -> None:
    page = text(found, seen(0.0), seen(20.0))
    (rmse,) = (term["reading"] for term in found.summary["odds"]["terms"] if term["kind"] == "rmse")
    for name in (BEFORE, *KINDS, "score", "inliers", "violations"):
        assert escape(EVIDENCE[name].text) in page, name
    assert with_unit("rmse", rmse).endswith("mm") and with_unit("rmse", rmse) in page


def test_matches_are_lines_over_both_pictures_with_a_switch_for_those_that_agree_and_one_for_the_rest(
    found: RegisteredPair,
) -> None:
    page = text(found, seen(0.0), seen(20.0))
    assert found.matches is not None and found.candidate is not None
    agree = int(agreeing(found.matches, found.candidate.T_target_source).sum())
    count = len(found.matches)
    assert f"{agree} of {count} matched features agree" in page
    assert f"{count - agree} of {count} matched features disagree" in page
    assert 'data-lines="agree" checked>' in page and 'data-lines="disagree">' in page
    groups = [page.split(f'<g class="{kind}">')[1].split("</g>")[0] for kind in ("agree", "disagree")]
    assert [group.count("<line") for group in groups] == [min(agree, MOST), min(count - agree, MOST)]
    assert page.count('<line class="mark') == len(found.candidate.matched)


def test_without_a_pose_no_feature_is_said_to_agree_or_to_disagree(found: RegisteredPair) -> None:
    page = text(replace(found, candidate=None), seen(0.0), seen(20.0))
    assert f"{len(found.matches or ())} features match; there is no pose" in page and "agree with" not in page
    assert "features match" not in text(replace(found, candidate=None, matches=None), seen(0.0), seen(20.0))


def test_a_page_does_without_pictures(found: RegisteredPair) -> None:
    assert text(found, seen(0.0), None).count("data:image/webp") == 1
    assert "no pictures at these times" in text(found, None, None)
