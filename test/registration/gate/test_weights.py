# SPDX-License-Identifier: Apache-2.0
"""The fitted weights: there is one for every knot, and none falls where the evidence gets better."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from objreg_ros.registration.gate.kinds import KINDS
from objreg_ros.registration.gate.weights import PRIOR, UNKNOWN, WEIGHTS


def test_every_kind_is_weighed_and_nothing_else() -> None:
    assert list(WEIGHTS) == list(UNKNOWN) == list(KINDS)


def test_better_evidence_never_weighs_less() -> None:
    for name in KINDS:
        weights, kind = np.array(WEIGHTS[name]), KINDS[name]
        assert len(weights) == len(kind.knots), name
        assert (np.diff(weights) >= 0.0).all() if kind.rises else (np.diff(weights) <= 0.0).all(), name


def test_what_is_unknown_weighs_no_more_than_the_best_that_could_be_known() -> None:
    for name in KINDS:
        assert UNKNOWN[name] <= max(WEIGHTS[name]), name


def test_no_kind_of_evidence_alone_makes_a_pose_likely() -> None:
    for name, weights in WEIGHTS.items():
        others = sum(min(WEIGHTS[other]) for other in WEIGHTS if other != name)
        assert PRIOR + max(weights) + others < 0.0


def test_the_reference_says_what_each_kind_weighs() -> None:
    reference = (Path(__file__).parents[3] / "docs" / "gate.md").read_text()
    for name, weights in WEIGHTS.items():
        (row,) = (line for line in reference.splitlines() if line.startswith(f"| `{name}` |"))
        assert f"| {min(weights):+.2f} … {max(weights):+.2f} |" in row, "make docs/gate.md as gate/weights.py is"
