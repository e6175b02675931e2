# SPDX-License-Identifier: Apache-2.0
"""Competing hypotheses: other poses that may be true. Of two that score the same one is wrong."""

from __future__ import annotations

from objreg_ros.data.closures import Reason
from objreg_ros.registration.gate.refusal import Refusal

LEAST_MARGIN = 0.1  # of the total score: a pose 48 cm off led by 0.02, three objects matched, and the print agreed


def check(score_margin: float, least: float) -> Refusal | None:
    """Refuse a pose over which another one that keeps gravity scores nearly as much; larger margins are weighed."""
    if score_margin >= least:
        return None
    return Reason.PROPOSERS_DISAGREE, f"another possible pose scores {score_margin:.2f} < {least:.2f} lower"
