# SPDX-License-Identifier: Apache-2.0
"""The search of a camera's own session that does not believe odometry: what a doubtful camera may have been taken to.

What it finds is no constraint: it says only whether odometry is wrong.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

from objreg_ros.data.checked import Array
from objreg_ros.memory.retrieval import CandidateKeyframe, Index
from objreg_ros.memory.sighting import Sighting
from objreg_ros.memory.store import StoreError
from objreg_ros.registrar.candidate_search import Budget, Means
from objreg_ros.registrar.consistency import Standpoint
from objreg_ros.registrar.localisation.localisation import Localisation
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration import align
from objreg_ros.registration.api import Gate
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.gate.likelihood import odds_of
from objreg_ros.registration.keyframe import Keyframe

TRIES = 2  # stored keyframes of each new one


def weigh_contrary(
    here: Localisation,
    keyframe: Keyframe,
    contrary: Iterable[tuple[Keyframe, Candidate]],
    gate: Gate,
    least_odds: float,
) -> None:
    """Take poses for rivals that the gate accepts where odometry is not asked, nor what neighbours say."""
    for target, candidate in contrary:
        odds = odds_of(candidate)  # by what else was proposed: a gate that is given one alone knows nothing of that
        if odds >= least_odds and isinstance(gate([candidate]), Candidate):
            here.add_rival(keyframe, target, candidate.T_target_source, odds)


def search_elsewhere(
    here: Localisation,
    keyframe: Keyframe,
    named: Sequence[Sighting],
    places: tuple[Index, frozenset[int]],
    means: Means,
    params: RegistrarParams,
    budget: Budget,
) -> None:
    """Search the session without odometry where it is doubtful; ``places`` are the index and the hidden sessions."""
    if here.is_doubtful:
        found = places_without_odometry(places[0], named, places[1], here.since_ns)
        for target, T, odds in accepted_poses(keyframe, found, means, params, budget):
            here.add_rival(keyframe, target, T, odds)


def places_without_odometry(
    index: Index, sightings: Sequence[Sighting], hidden: frozenset[int], since_ns: int
) -> list[CandidateKeyframe]:
    """Keyframes of the session since ``since_ns`` that may show the objects, wherever odometry has them."""
    session = sightings[0].session
    asked = [replace(one, by_odometry=False) for one in sightings]
    found = [one for one in index.query(asked, hidden) if one.session == session and one.stamp_ns >= since_ns]
    return found[:TRIES]


def accepted_poses(
    keyframe: Keyframe, places: Sequence[CandidateKeyframe], means: Means, params: RegistrarParams, budget: Budget
) -> Iterator[tuple[Keyframe, Array, float]]:
    """The keyframes with which it is registered, where the gate accepts that: with ``T_target_source`` and odds.

    What a person withdrew is none of them.
    """
    trying = []
    for place in places:
        if budget.over():
            break
        try:
            target = means.store.keyframe(place.keyframe_id)
        except StoreError:  # what is damaged is reported where it is used
            continue
        means.method.prepare(keyframe)
        trying.append((target, means.pool.submit(align, keyframe, target, None, params, means.method, means.gate)))
    for target, asked in trying:
        found = asked.result()
        if found.accepted and found.candidate is not None and not _is_vetoed(keyframe, target, found.candidate, means):
            yield target, found.T_target_source, odds_of(found.candidate)


def _is_vetoed(keyframe: Keyframe, target: Keyframe, found: Candidate, means: Means) -> bool:
    return means.vetoes.covers(Standpoint.of(keyframe), Standpoint.of(target), found.T_target_source)
