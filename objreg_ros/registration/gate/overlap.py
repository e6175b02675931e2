# SPDX-License-Identifier: Apache-2.0
"""Overlap: how much both views see, and how much of that agrees in depth."""

from __future__ import annotations

from typing import NamedTuple

from objreg_ros.data import Reason
from objreg_ros.registration.gate.refusal import Refusal


class Limits(NamedTuple):
    """The least that both views must share."""

    tested: int = 600  # pixels of both views that land in the other one
    inliers: float = 0.35  # share of the tested pixels whose depth agrees


def check(tested: int, inliers: float, limits: Limits) -> Refusal | None:
    """Refuse a pose under which the views share too little."""
    if tested < limits.tested:
        return Reason.LOW_OVERLAP, f"{tested} pixels tested < {limits.tested}"
    if inliers < limits.inliers:
        return Reason.LOW_OVERLAP, f"inliers {inliers:.2f} < {limits.inliers:.2f}"
    return None
