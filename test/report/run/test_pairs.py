# SPDX-License-Identifier: Apache-2.0
"""Every pair of a run, each with its verdict and its numbers."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_tools.report.run.pairs import by_interest, pairs_of
from objreg_tools.report.run.run_summary import RunSummary
from objreg_tools.truth import Truth
from report.runs import STEP_NS, TRUTH, closure, refusal, summary

RUN = RunSummary.of("walk", summary(false=True), TRUTH)


def test_every_constraint_and_every_refusal_is_a_pair() -> None:
    pairs = pairs_of(RUN)
    assert [pair.key for pair in pairs] == ["c0", "c1", "c2", "c3", "c4", "r0", "r1", "r2"]
    assert [pair.verdict for pair in pairs] == [*["accepted"] * 4, "false", *["refused"] * 3]
    assert [pair.reason for pair in pairs[4:7]] == ["accepted", "no_candidate", "texture_disagrees"]


def test_a_pair_states_its_error_where_truth_is_known() -> None:
    pair = pairs_of(RUN)[4]
    assert pair.error == pytest.approx((0.0, 50.0), abs=1e-4)
    assert "In truth 120° and 1.7 m apart; the pose is off by 0.0° and 50.0 cm." in pair.text
    unjudged = pairs_of(RunSummary.of("walk", summary(), Truth([])))[0]
    assert unjudged.error is None and unjudged.text == ""


def test_the_labels_of_a_refusal_are_those_detected_at_both_moments() -> None:
    stated = summary()
    labels = {0: ["cup", "book"], 70: ["book", "mug"]}
    stated["glimpses"] = [{"stamp_ns": k * STEP_NS, "labels": names} for k, names in labels.items()]
    stated["refusals"] = [refusal("texture_disagrees", 0, 70), refusal("texture_disagrees", 0, 71)]
    assert [pair.labels for pair in pairs_of(RunSummary.of("walk", stated, TRUTH))[-2:]] == [("book",), ()]


def test_what_was_refused_says_why_and_what_moved_says_so() -> None:
    moved = {**closure(5, 65), "evidence": {"moved cup [m]": 0.4}}
    pairs = pairs_of(RunSummary.of("walk", {**summary(), "constraints": [moved]}, TRUTH))
    assert pairs[0].text.startswith("cup moved by 0.40 m. In truth")
    assert pairs[2].text.startswith("0.3 < 0.5 & texture_disagrees. In truth")


def test_false_constraints_are_looked_at_first_and_what_was_not_tried_last() -> None:
    stated = summary(false=True)
    stated["refusals"][1]["T_from_to"] = np.eye(4).tolist()
    order = [pair.key for pair in by_interest(pairs_of(RunSummary.of("walk", stated, TRUTH)))]
    assert order == ["c4", "c0", "c1", "c2", "c3", "r1", "r2", "r0"]


def test_a_pair_of_two_cameras_names_them_with_their_robots() -> None:
    stated = summary()
    stated["constraints"][0] |= {"from_robot": "a", "to_robot": "b", "from_frame_id": "front", "to_frame_id": "front"}
    stated["constraints"][1] |= {"from_frame_id": "front", "to_frame_id": "rear"}
    first, second, third, *_ = pairs_of(RunSummary.of("run", stated, TRUTH))
    assert first.text.startswith("a/front, then b/front") and second.text.startswith("front, then rear")
    assert ", then " not in third.text
