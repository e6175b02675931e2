# SPDX-License-Identifier: Apache-2.0
"""Overlap."""

from __future__ import annotations

import pytest

from objreg_ros.data import Reason
from objreg_ros.registration.gate import overlap


@pytest.mark.parametrize(
    ("tested", "inliers", "text"),
    [(600, 0.35, None), (599, 0.9, "599 pixels tested < 600"), (600, 0.34, "inliers 0.34 < 0.35")],
)
def test_the_views_must_share_pixels_and_agree_in_depth(tested: int, inliers: float, text: str | None) -> None:
    refusal = overlap.check(tested, inliers, overlap.Limits(tested=600, inliers=0.35))
    assert refusal == (None if text is None else (Reason.LOW_OVERLAP, text))
