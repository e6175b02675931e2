# SPDX-License-Identifier: Apache-2.0
"""Which of the states it is: a pure function of probabilities, and the sentence that gives the numbers."""

from __future__ import annotations

import math
from typing import NamedTuple

from objreg_ros.data.localisation import State

WITHIN_M = 0.5  # of the truth, which is asked for
LEAST_SURE = 0.9  # probability of that
LOST_FROM = 0.5  # probability of being elsewhere


class Standing(NamedTuple):
    """What is known at a frame: the probability of being ``elsewhere``, ``sigma_m`` of each axis (NaN: no map is tied),
    ``age_s`` of the last closure (NaN: none), which known objects are ``missing``, how many closures ``contradict``
    odometry, a sentence of how the camera was ``kidnapped``, empty where it was not, and one of two places that fit
    ``alike``, empty where none do.
    """

    elsewhere: float
    sigma_m: float
    age_s: float
    missing: int
    contradicting: int
    kidnapped: str = ""
    alike: str = ""

    @property
    def probability(self) -> float:
        """That the pose in the map is within `WITHIN_M` of the truth; NaN where none is tied."""
        return (1.0 - self.elsewhere) * within(WITHIN_M, self.sigma_m)


def within(metres: float, sigma_m: float) -> float:
    """The probability that three normal numbers of this deviation are a point no farther away; NaN where it is."""
    if math.isnan(sigma_m) or sigma_m <= 0.0:
        return 1.0 if sigma_m <= 0.0 else math.nan
    r = metres / sigma_m  # Maxwell's distribution
    return math.erf(r / math.sqrt(2.0)) - math.sqrt(2.0 / math.pi) * r * math.exp(-0.5 * r * r)


def state_of(now: Standing) -> State:
    """The state of all that is known."""
    if now.kidnapped:
        return State.KIDNAPPED
    if now.elsewhere >= LOST_FROM:
        return State.LOST
    if now.alike:
        return State.AMBIGUOUS
    if math.isnan(now.sigma_m):
        return State.TRACKING
    return State.SURE if now.probability >= LEAST_SURE else State.UNSURE


def reason_of(now: Standing) -> str:
    """A sentence with the numbers."""
    if now.kidnapped:
        return now.kidnapped
    known = "" if math.isnan(now.age_s) else f", the last closure {now.age_s:.1f} s ago"
    doubt = f"{now.missing} known objects are missing, {now.contradicting} closures contradict odometry"
    if now.elsewhere >= LOST_FROM:
        return f"elsewhere with a probability of {now.elsewhere:.2f}: {doubt}{known}"
    if now.alike:
        return f"two places of a map fit alike: {now.alike}{known}"
    if math.isnan(now.sigma_m):
        return f"no map of an earlier session is tied; {doubt}{known}"
    return f"within {WITHIN_M} m with a probability of {now.probability:.2f}, sigma {now.sigma_m:.2f} m; {doubt}{known}"
