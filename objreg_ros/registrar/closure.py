# SPDX-License-Identifier: Apache-2.0
"""From a registered pair of keyframes to what is told of it: a closure, a refusal, the objects under their ids."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from objreg_ros.data import UNNAMED, Array, LoopClosure, ObjectMatch, Observation, Rejected
from objreg_ros.geometry import transform
from objreg_ros.memory.landmarks import Link
from objreg_ros.memory.sighting import Sighting
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.certainty.covariance import covariance_of
from objreg_ros.registration.gate.verdict import Refusal
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.params import RegistrarParams
from objreg_ros.registration.result import Registration, evidence_of


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Accepted:
    """A stored keyframe and the pose that the gate accepted of a new one in it."""

    target: Keyframe
    candidate: Candidate


def verdict_of(keyframe: Keyframe, target: Keyframe, registration: Registration) -> Accepted | Rejected:
    """What a registration upon the stored ``target`` comes to; ValueError where a gate gave no reason."""
    candidate, reason = registration.candidate, registration.reason
    if reason is None and candidate is not None:
        return Accepted(target=target, candidate=candidate)
    if reason is None:
        raise ValueError("gate: expected a reason with each refusal, got None")
    best = None if candidate is None else candidate.T_target_source
    return rejected(target.stamp_ns, keyframe, (reason, registration.detail), best)


def rejected(from_ns: int, keyframe: Keyframe, refusal: Refusal, T_from_to: Array | None = None) -> Rejected:
    """A refusal as it is published; ``T_from_to (4, 4)`` is the best pose that was refused, if any."""
    reason, detail = refusal
    return Rejected(reason=reason, from_ns=from_ns, to_ns=keyframe.stamp_ns, detail=detail, T_from_to=T_from_to)


def closure_of(
    keyframe: Keyframe, sightings: Sequence[Sighting], item: Accepted, params: RegistrarParams
) -> LoopClosure:
    """The constraint of an accepted candidate; ``sightings`` are the keyframe's, with their landmarks."""
    candidate = item.candidate
    matches = tuple(
        ObjectMatch(label=pair.label, object_id=sightings[pair.source].landmark) for pair in candidate.matched
    )
    return LoopClosure(
        from_ns=item.target.stamp_ns,
        to_ns=keyframe.stamp_ns,
        T_from_to=candidate.T_target_source,
        covariance=covariance_of(candidate, params),
        labels=tuple(dict.fromkeys(match.label for match in matches)) or tuple(dict.fromkeys(keyframe.labels)),
        matches=matches,
        evidence=evidence_of(candidate) | _moved(keyframe, item),
        from_frame_id=item.target.frame_id,
        to_frame_id=keyframe.frame_id,
    )


def observations(keyframe: Keyframe, sightings: Sequence[Sighting]) -> tuple[Observation, ...]:
    """The objects of a keyframe under the ids of the landmarks that its ``sightings`` are of."""
    return tuple(
        Observation(label=sighting.label, object_id=sighting.landmark, xyz=item.centroid)
        for item, sighting in zip(keyframe.objects, sightings, strict=True)
    )


def links_of(keyframe: Keyframe, item: Accepted, stored: Sequence[Sighting]) -> list[Link]:
    """Which objects of a keyframe are which ``stored`` ones of the target, by the accepted pose."""
    of = {sighting.instance: sighting for sighting in stored}
    R_there_here = _rotation(item.target) @ item.candidate.T_target_source[:3, :3] @ _rotation(keyframe).T
    return [
        Link(index=pair.source, of=of[item.target.objects[pair.target].cloud.instance], R_there_here=R_there_here)
        for pair in item.candidate.matched
    ]


def _moved(keyframe: Keyframe, item: Accepted) -> dict[str, float]:
    """How far the objects went that stand elsewhere now, under `MOVED`'s names; the farthest of several of one.

    Of two without a name nobody knows whether they are the same.
    """
    found: dict[str, float] = {}
    for pair in (pair for pair in item.candidate.moved if pair.label != UNNAMED):
        here = transform(item.candidate.T_target_source, keyframe.objects[pair.source].centroid)
        metres = float(np.linalg.norm(here - item.target.objects[pair.target].centroid))
        name = f"moved {pair.label} [m]"
        found[name] = max(metres, found.get(name, 0.0))
    return found


def _rotation(keyframe: Keyframe) -> Array:
    return np.eye(3) if keyframe.T_odom_camera is None else keyframe.T_odom_camera[:3, :3]
