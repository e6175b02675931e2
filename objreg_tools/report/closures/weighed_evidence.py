# SPDX-License-Identifier: Apache-2.0
"""The evidence of a pair in plain words, with how much each number spoke for the pose or against it.

The gate adds up weights, decimal logarithms: one of +1 makes a right pose ten times as likely. They are computed here
from the published readings by the function of the gate, so their sum is the logarithm of the published odds. Where it
is not, other weights judged the pair, and none is shown.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isclose, log10
from typing import NamedTuple

from objreg_ros.registration.gate.free_space import LIMITS as FREE_SPACE
from objreg_ros.registration.gate.kinds import KINDS
from objreg_ros.registration.gate.likelihood import BEFORE, ODDS, terms
from objreg_ros.registration.gate.limits import LIMITS

TOLERANCE = 0.01  # of the logarithm: published numbers are rounded


class Name(NamedTuple):
    """A number of the evidence for a reader."""

    text: str
    unit: str = ""
    limit: str = ""  # what a rule of the gate asks of it; empty where it is only weighed, or only shown
    scale: float = 1.0  # from the published number to the unit


EVIDENCE = {
    BEFORE: Name("before any evidence"),
    "tested": Name("pixels that both views see"),
    "certain_violations": Name("pixels certainly in seen free space", "%", f"≤ {100 * FREE_SPACE.certain:g} %", 100.0),
    "correlation": Name("the pictures agree (correlation)"),
    "silhouettes": Name("the objects' outlines agree, −1 to 1"),
    "matched": Name("objects on each other", "", "≥ 1 named, or 3"),
    "proposers": Name("independent algorithms that found it"),
    "score_margin": Name("lead over the next possible pose", "", f"≥ {LIMITS.score_margin:g}"),
    "perturbation_margin": Name("view score lost if it is moved by 15 cm"),
    "position_sigma": Name("position unsure by, surfaces alone", "cm", "", 100.0),
    "scaled_sigma": Name("position unsure by, all together", "cm", "", 100.0),
    "rmse": Name("surfaces apart (RMS)", "mm", "", 1000.0),
    "range": Name("distance of what is seen", "m"),
    "odds": Name("right poses for each false one (odds)"),
    "score": Name("view score V"),
    "inliers": Name("pixels whose depth agrees", "%", "", 100.0),
    "violations": Name("pixels in seen free space", "%", f"≤ {100 * FREE_SPACE.violations:g} %", 100.0),
    "occluded": Name("pixels hidden from the other view", "%", "", 100.0),
    "keypoints": Name("parts of the picture with agreeing keypoints"),
    "overlap": Name("points with a partner", "%", "", 100.0),
    "moved": Name("objects that moved", "", "≤ matched"),
    "gravity_error_deg": Name("gravities apart", "°", f"≤ {LIMITS.gravity_sigmas:g} deviations"),
    "surroundings_score": Name("view score around the objects", "", f"≥ {LIMITS.surroundings.score:g} around one"),
    "yaw_known": Name("an object shows its yaw (1: yes)"),
    "agreeing": Name("keyframes that agree"),
    "agreeing_share": Name("of all keyframes, those that agree", "%", "", 100.0),
}
"""By the name under which it is published."""


@dataclass(frozen=True, slots=True)
class Reading:
    """One number of the evidence: its key in `EVIDENCE`, its text with its unit, and its weight, None without one."""

    key: str
    value: str
    weight: float | None = None


@dataclass(frozen=True, slots=True)
class Weighed:
    """All evidence of a pair, what was weighed first; ``total`` is the logarithm of the odds, None without weights.

    ``least`` is the logarithm of the least odds that the gate asked for.
    """

    readings: tuple[Reading, ...]
    total: float | None
    least: float


def weighed(evidence: Mapping[str, float], least_odds: float = ODDS) -> Weighed:
    """The evidence of a constraint or a refusal as its JSON names it; names with spaces are taken, too."""
    known = {name.replace(" ", "_") if _is_published(name) else name: value for name, value in evidence.items()}
    weights = _weights(known)
    first = [Reading(name, with_unit(name, known.get(name)), weight) for name, weight in weights.items()]
    rest = [Reading(name, with_unit(name, value)) for name, value in known.items() if name not in weights]
    return Weighed((*first, *rest), sum(weights.values()) if weights else None, log10(max(least_odds, 1e-9)))


def _is_published(name: str) -> bool:
    return name.replace(" ", "_") in EVIDENCE


def _weights(evidence: Mapping[str, float]) -> dict[str, float]:
    """The terms of the odds; none where their sum is not the logarithm of those that are published."""
    odds = evidence.get("odds", 0.0)
    found = terms({name: evidence.get(name) for name in KINDS})
    same = odds > 0.0 and isclose(sum(found.values()), log10(odds), abs_tol=TOLERANCE)
    return found if same else {}


def with_unit(key: str, value: float | None) -> str:
    """A number of the evidence with its unit; of what was not measured ``not known``."""
    if key == BEFORE:
        return ""
    if value is None:
        return "not known"
    name = EVIDENCE.get(key, Name(key))
    scaled = value * name.scale
    number = f"{scaled:,.0f}" if abs(scaled) >= 1000 else f"{scaled:.3g}"
    number = number.replace("-", "−")
    return f"{number}{'' if name.unit in ('', '°', '%') else ' '}{name.unit}"
