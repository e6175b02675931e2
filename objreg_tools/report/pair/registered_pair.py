# SPDX-License-Identifier: Apache-2.0
"""Two keyframes registered once more, with all that the steps saw: what was proposed, what became of it, and the odds.

The first keyframe is the target, the second the source: ``T_1_2`` maps points of camera 2 into camera 1.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from math import log10
from typing import Any

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import pose_error, rotation_angle
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.engine import Engine
from objreg_ros.registration.gate.kinds import readings_of
from objreg_ros.registration.gate.likelihood import log_odds, odds_of, weigh
from objreg_ros.registration.gate.limits import Limits, limits_of
from objreg_ros.registration.gate.verdict import compared, judge, refuse
from objreg_ros.registration.gate.weights import PRIOR
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.params import RegistrationParams
from objreg_ros.registration.prepare.keypoints import KeypointMatches
from objreg_ros.registration.prepare.prepared import Pair, Prepared
from objreg_ros.registration.propose.evidence import CONSIDERED_MARGIN
from objreg_ros.registration.propose.shortlist import Shortlist, shortlist
from objreg_tools.report.closures.weighed_evidence import EVIDENCE

ACCEPTED = "accepted"


@dataclass(slots=True)
class _Watched:
    """Our proposer, which keeps what it was given and what it proposed."""

    pair: Pair | None = None
    proposed: Shortlist | None = None

    def __call__(self, pair: Pair, T_target_source_prior: Array | None) -> Shortlist:
        self.pair, self.proposed = pair, shortlist(pair, T_target_source_prior)
        return self.proposed


@dataclass(frozen=True, slots=True)
class RegisteredPair:
    """What came out of two keyframes.

    ``summary`` has it as JSON. ``candidate`` was accepted, or is the best of those that were refused; None where no
    pose was proposed. ``matches`` are those of the keypoints, from the second frame to the first; None where nothing
    was proposed from.
    """

    first: Keyframe
    second: Keyframe
    summary: dict[str, Any]
    candidate: Candidate | None
    matches: KeypointMatches | None


def register_pair(
    first: Keyframe, second: Keyframe, params: RegistrationParams, T_true: Array | None = None
) -> RegisteredPair:
    """Register two keyframes; ``T_true (4, 4)`` is the true ``T_1_2``, None where it is not known.

    ValueError where ``params`` ask for another method than ours, whose steps are shown here.
    """
    if params.method != "objreg":
        raise ValueError(f"registrar.method: expected objreg, whose steps are shown here, got {params.method}")
    watched, limits = _Watched(), limits_of(params)
    candidates = Engine(params, propose=watched).propose(second, first)
    verdict = judge(candidates, limits=limits)
    ranked = compared(candidates, limits)
    chosen = verdict if isinstance(verdict, Candidate) else next(iter(ranked), None)
    summary = {
        "accepted": isinstance(verdict, Candidate),
        "reason": ACCEPTED if isinstance(verdict, Candidate) else verdict[0].value,
        "detail": "" if isinstance(verdict, Candidate) else verdict[1],
        "T_1_2": chosen.T_target_source.tolist() if isinstance(verdict, Candidate) and chosen is not None else None,
        "truth": None if T_true is None else _moved(T_true),
        "error": None if chosen is None else _error(chosen, T_true),
        "frames": [_frame(one, prepared) for one, prepared in zip((first, second), _prepared(watched), strict=True)],
        "keypoint_matches": 0 if watched.pair is None else len(watched.pair.keypoint_matches),
        "hypotheses": _hypotheses(watched.proposed),
        "candidates": [_candidate(one, ranked, limits, verdict, T_true) for one in ranked],
        "odds": None if chosen is None else _odds(chosen, limits),
    }
    matches = None if watched.pair is None else watched.pair.keypoint_matches
    return RegisteredPair(first, second, summary, chosen, matches)


def _prepared(watched: _Watched) -> tuple[Prepared | None, Prepared | None]:
    return (None, None) if watched.pair is None else (watched.pair.target, watched.pair.source)


def _frame(keyframe: Keyframe, prepared: Prepared | None) -> dict[str, Any]:
    """What is known of one frame before it meets the other."""
    objects = [
        {
            "label": item.label,
            "points": len(item.cloud),
            "size_m": round(item.extent, 3),
            "distance_m": round(float(np.linalg.norm(item.centroid)), 3),
        }
        for item in keyframe.objects
    ]
    return {
        "stamp_ns": keyframe.stamp_ns,
        "objects": objects,
        "features": 0 if prepared is None else len(prepared.features.xyz),
        "keypoints": 0 if prepared is None else len(prepared.keypoints),
        "gravity": None if keyframe.gravity is None else keyframe.gravity.round(4).tolist(),
    }


def _hypotheses(proposed: Shortlist | None) -> list[dict[str, Any]]:
    """How many poses each proposer has among those that views and objects were asked about, and how many went on."""
    if proposed is None:
        return []
    asked = Counter(one.proposer for one in proposed.hypotheses)
    finished = Counter(one.proposer for one in proposed.best)
    first = Counter(one.proposer for one in proposed.of_keypoints)
    names = sorted({*asked, *finished, *first})
    return [
        {"proposer": name, "asked": asked[name], "finished": finished[name], "of_keypoints": first[name]}
        for name in names
    ]


def _candidate(
    one: Candidate, ranked: Sequence[Candidate], limits: Limits, verdict: Any, T_true: Array | None
) -> dict[str, Any]:
    """A pose that was finished: who proposed it, its evidence, and what became of it."""
    seen = one.verification
    behind = ranked[0].verification.score - seen.score
    refusal = refuse(one, limits=limits)
    if behind > CONSIDERED_MARGIN:
        became = f"not considered: V is {behind:.2f} below that of the best"
    elif refusal is not None:
        became = f"{refusal[0].value}: {refusal[1]}"
    else:
        is_chosen = isinstance(verdict, Candidate) and verdict.alignment is one.alignment
        became = ACCEPTED if is_chosen else "not needed: a better one was accepted"
    return {
        "proposers": list(one.agreeing_proposers),
        "score": round(seen.score, 4),
        "inliers": round(seen.inliers, 4),
        "violations": round(seen.violations, 4),
        "correlation": None if seen.correlation is None else round(seen.correlation, 4),
        "matched": [pair.label for pair in one.matched],
        "moved": [pair.label for pair in one.moved],
        "odds": odds_of(one),
        "pose": _moved(one.T_target_source),
        "error": _error(one, T_true),
        "became": became,
    }


def _odds(one: Candidate, limits: Limits) -> dict[str, Any]:
    """The terms of the odds in decimal logarithms: they add up to the ``sum``."""
    readings = readings_of(one)
    terms = [
        {"kind": name, "phrase": EVIDENCE[name].text, "reading": reading, "weight": round(weigh(name, reading), 4)}
        for name, reading in readings.items()
    ]
    total = log_odds(readings)
    return {
        "prior": PRIOR,
        "terms": terms,
        "sum": round(total, 4),
        "least": round(log10(limits.odds), 4),
        "odds": 10.0**total,
        "least_odds": limits.odds,
    }


def _moved(T: Array) -> dict[str, float]:
    """How far camera 2 is from camera 1."""
    degrees, metres = np.degrees(rotation_angle(T[:3, :3])), float(np.linalg.norm(T[:3, 3]))
    return {"rotation_deg": round(float(degrees), 3), "translation_m": round(metres, 4)}


def _error(one: Candidate, T_true: Array | None) -> dict[str, float] | None:
    if T_true is None:
        return None
    degrees, centimetres = pose_error(one.T_target_source, T_true)
    return {"rotation_deg": round(degrees, 3), "translation_cm": round(centimetres, 3)}
