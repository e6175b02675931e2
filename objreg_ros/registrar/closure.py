# SPDX-License-Identifier: Apache-2.0
"""From a registered pair of keyframes to what is reported of it: a closure, a refusal, the objects under their ids."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure, ObjectMatch, Observation, Reason, Rejected, refused
from objreg_ros.data.frames import UNNAMED
from objreg_ros.geometry import transform
from objreg_ros.memory.landmarks import Link
from objreg_ros.memory.sighting import Sighting
from objreg_ros.registrar.consistency import Standpoint, Support
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.certainty.covariance import covariance_of
from objreg_ros.registration.gate.verdict import Refusal
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.result import evidence_of


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Decision:
    """A pose of a new keyframe in a stored one, ``target``, and what becomes of it.

    It is accepted where ``refusal`` is None. Else it waits for other keyframes by the number of its statement,
    ``waits_as``, and is refused for that where they do not confirm it. ``support`` is what others say of it, where that
    was asked. ``statement`` is the number of its statement, None where it made none.
    """

    target: Keyframe
    candidate: Candidate
    support: Support | None = None
    refusal: Refusal | None = None
    waits_as: int | None = None
    statement: int | None = None

    @property
    def accepted(self) -> bool:
        """Whether it is published now."""
        return self.refusal is None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WaitingClosure:
    """A constraint that waits for others to confirm it; ``accepted`` by the gate, and others disagree.

    ``refusal`` is what becomes of it if none do. ``pairs`` are the instances of each matched object in the keyframes
    ``source_id`` and ``target_id``, which stood ``here`` and ``there``; ``R_there_here (3, 3)`` as in `Link`.
    """

    closure: LoopClosure
    refusal: Refusal
    accepted: bool
    source_id: int
    target_id: int
    here: Standpoint
    there: Standpoint
    pairs: tuple[tuple[int, int], ...]
    R_there_here: Array

    @property
    def from_session(self) -> int:
        """The session of the stored keyframe."""
        session = self.closure.from_session
        assert session is not None
        return session

    def confirmed(self, support: Support) -> WaitingClosure:
        """The same with what others say of it as evidence."""
        evidence = self.closure.evidence | support_evidence(support)
        return replace(self, closure=replace(self.closure, evidence=evidence))

    def renamed(self, landmarks: Mapping[int, int]) -> WaitingClosure:
        """The same under the ids that its objects have by now, by their instance in the later keyframe."""
        matches = tuple(
            replace(match, object_id=landmarks.get(here, match.object_id))
            for match, (here, _) in zip(self.closure.objects, self.pairs, strict=True)
        )
        return replace(self, closure=replace(self.closure, objects=matches))

    def refused(self, refusal: Refusal) -> Rejected:
        """The refusal that it comes to."""
        return refused(self.closure, *refusal)


def rejected(from_ns: int, keyframe: Keyframe, refusal: Refusal, target: Keyframe | None = None) -> Rejected:
    """A refusal as it is published, without a pose; ``target`` is the keyframe at ``from_ns``, None if not read."""
    reason, detail = refusal
    return Rejected(
        reason=reason,
        from_ns=from_ns,
        to_ns=keyframe.stamp_ns,
        detail=detail,
        from_frame_id="" if target is None else target.frame_id,
        to_frame_id=keyframe.frame_id,
        from_session=None if target is None else target.session,
        to_session=keyframe.session,
        from_robot="" if target is None else target.robot,
        to_robot=keyframe.robot,
    )


def redundant(seconds: float) -> Refusal:
    """Why a constraint of two keyframes is not published where another of them is known."""
    return Reason.REDUNDANT, f"an accepted closure is nearer than {seconds} s"


def closure_of(
    keyframe: Keyframe, sightings: Sequence[Sighting], decision: Decision, params: RegistrarParams
) -> LoopClosure:
    """The constraint of an accepted candidate; ``sightings`` are the keyframe's, with their landmarks."""
    candidate = decision.candidate
    matches = tuple(
        ObjectMatch(label=pair.label, object_id=sightings[pair.source].landmark) for pair in candidate.matched
    )
    return LoopClosure(
        from_ns=decision.target.stamp_ns,
        to_ns=keyframe.stamp_ns,
        T_from_to=candidate.T_target_source,
        covariance=covariance_of(candidate, params),
        labels=tuple(dict.fromkeys(match.label for match in matches)) or tuple(dict.fromkeys(keyframe.labels)),
        objects=matches,
        evidence=evidence_of(candidate) | _moved(keyframe, decision) | support_evidence(decision.support),
        from_frame_id=decision.target.frame_id,
        to_frame_id=keyframe.frame_id,
        from_session=decision.target.session,
        to_session=keyframe.session,
        from_robot=decision.target.robot,
        to_robot=keyframe.robot,
    )


def waiting_of(
    keyframe: Keyframe, sightings: Sequence[Sighting], decision: Decision, refusal: Refusal, params: RegistrarParams
) -> WaitingClosure:
    """What is kept of a pose that waits: no clouds. ``sightings`` as for `closure_of`."""
    here, there = keyframe.objects, decision.target.objects
    return WaitingClosure(
        closure=closure_of(keyframe, sightings, decision, params),
        refusal=refusal,
        accepted=refusal[0] is Reason.NEIGHBOURS,
        source_id=keyframe.keyframe_id,
        target_id=decision.target.keyframe_id,
        here=Standpoint.of(keyframe),
        there=Standpoint.of(decision.target),
        pairs=tuple(
            (here[pair.source].cloud.instance, there[pair.target].cloud.instance) for pair in decision.candidate.matched
        ),
        R_there_here=_turn(keyframe, decision),
    )


def support_evidence(support: Support | None) -> dict[str, float]:
    """What others say of a pose, as evidence of its constraint; nothing where that was not asked."""
    return {} if support is None else {"agreeing": float(support.agreeing), "agreeing_share": support.share}


def observations(keyframe: Keyframe, sightings: Sequence[Sighting]) -> tuple[Observation, ...]:
    """The objects of a keyframe under the ids of the landmarks that its ``sightings`` are of."""
    return tuple(
        Observation(label=sighting.label, object_id=sighting.landmark, xyz=item.centroid)
        for item, sighting in zip(keyframe.objects, sightings, strict=True)
    )


def links_of(keyframe: Keyframe, decision: Decision, stored: Sequence[Sighting]) -> list[Link]:
    """Which objects of a keyframe are which ``stored`` ones of the target, by the accepted pose."""
    of = {sighting.instance: sighting for sighting in stored}
    R_there_here = _turn(keyframe, decision)
    return [
        Link(index=pair.source, of=of[decision.target.objects[pair.target].cloud.instance], R_there_here=R_there_here)
        for pair in decision.candidate.matched
    ]


def _moved(keyframe: Keyframe, decision: Decision) -> dict[str, float]:
    """How far the objects went that stand elsewhere now, under `MOVED`'s names; the farthest of several of one.

    Two without a name may or may not be the same.
    """
    found: dict[str, float] = {}
    for pair in (pair for pair in decision.candidate.moved if pair.label != UNNAMED):
        here = transform(decision.candidate.T_target_source, keyframe.objects[pair.source].centroid)
        metres = float(np.linalg.norm(here - decision.target.objects[pair.target].centroid))
        name = f"moved {pair.label} [m]"
        found[name] = max(metres, found.get(name, 0.0))
    return found


def _turn(keyframe: Keyframe, decision: Decision) -> Array:
    """(3, 3) from the axes of the keyframe's session into those of the target's."""
    return _rotation(decision.target) @ decision.candidate.T_target_source[:3, :3] @ _rotation(keyframe).T


def _rotation(keyframe: Keyframe) -> Array:
    return np.eye(3) if keyframe.T_odom_camera is None else keyframe.T_odom_camera[:3, :3]
