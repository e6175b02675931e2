# SPDX-License-Identifier: Apache-2.0
"""How likely a pose is right, by all that is seen: the weights of evidence, added up.

The weight of a reading is the decimal logarithm of how much likelier it is under a right pose than under a false one,
beside all the others (Good, "Probability and the weighing of evidence", 1950): an additive logistic model (Hastie and
Tibshirani, "Generalized additive models", 1986), each term of it piecewise linear and monotone. Their sum with the
prior is the logarithm of the odds. They hold where as many right as false poses are asked about; what the fit knows of
them is in `weights`, and `training/likelihood.py` shows on recordings that it has not seen whether they are true.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import log10

import numpy as np

from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.gate.kinds import KINDS, readings_of
from objreg_ros.registration.gate.refusal import Refusal
from objreg_ros.registration.gate.weights import PRIOR, UNKNOWN, WEIGHTS

BEFORE = "prior"  # of the terms: what is known before any evidence
ODDS = 75.0  # right poses for each false one, among poses as sure as the least sure one that is accepted


def odds_of(candidate: Candidate) -> float:
    """How many right poses stand against a false one with evidence like this."""
    return float(10.0 ** log_odds(readings_of(candidate)))


def log_odds(readings: Mapping[str, float | None]) -> float:
    """The decimal logarithm of the odds that a pose with such readings is right; a kind that is missing is unknown."""
    before, *weights = terms(readings).values()
    return before + sum(weights)


def terms(readings: Mapping[str, float | None]) -> dict[str, float]:
    """What `log_odds` adds up, in decimal logarithms: the `BEFORE` of all evidence, then the weight of each kind."""
    return {BEFORE: PRIOR} | {name: weigh(name, readings.get(name)) for name in KINDS}


def weigh(name: str, reading: float | None) -> float:
    """The weight of a reading of one kind of evidence; 0 of a kind that no fit has seen yet."""
    kind = KINDS[name]
    if name not in WEIGHTS:
        return 0.0
    return UNKNOWN[name] if reading is None else float(np.interp(kind.scaled(reading), kind.knots, WEIGHTS[name]))


def check(candidate: Candidate, least_odds: float) -> Refusal | None:
    """Refuse a candidate whose odds are below ``least_odds``, for the kind of evidence that it lacks most of."""
    readings = readings_of(candidate)
    found = log_odds(readings)
    if found >= log10(least_odds):
        return None
    lacking = {name: max(WEIGHTS[name]) - weigh(name, reading) for name, reading in readings.items() if name in WEIGHTS}
    worst = max(lacking, key=lambda name: lacking[name])
    reading = readings[worst]
    value = "unknown" if reading is None else f"{reading:.3g}"
    return KINDS[worst].reason, f"odds {10.0**found:.2g} < {least_odds:g}, most for {KINDS[worst].phrase} {value}"
