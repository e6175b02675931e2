# SPDX-License-Identifier: Apache-2.0
"""Which poses between keyframes agree, where odometry carries one to the other.

Pairwise consistency (Olson, "Recognizing places using spectrally clustered local matches", 2009; Mangelson et al.,
"Pairwise consistent measurement set maximization for robust multi-robot map merging", 2018). Wrong poses agree as well
where they slide along the same surface. So what disagrees counts too, unless it is by no more than odometry jitters.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse
from objreg_ros.keyframes.jitter import ENDS, Jitter, JitterMeter
from objreg_ros.registration.keyframe import Keyframe

REACH_M = 3.0  # of path, at both ends together, over which odometry carries a pose
NEAR_M = 2.0  # of path: poses so near are of the same place
ROTATION_DEG, ROTATION_GROWTH_DEG_M = 2.0, 2.0  # between poses that agree: the noise of both, and of the path
TRANSLATION_M, TRANSLATION_GROWTH = 0.05, 0.06
MEASURED_M = 1.0  # of path, over which jitter is measured: drift is little by then
TOLERANCE_SIGMAS = 1.5  # times the root mean square of what is no jitter: 9 of 10 true poses agree then
MOST = 512  # statements that are kept, the newest


class Standpoint(NamedTuple):
    """Where a keyframe of ``robot`` was: ``T_session_camera (4, 4)``, ``travelled`` m in its session."""

    stamp_ns: int
    session: int
    T_session_camera: Array
    travelled: float
    robot: str = ""

    @classmethod
    def of(cls, keyframe: Keyframe) -> Standpoint:
        """Of a keyframe."""
        T = keyframe.T_odom_camera
        return cls(
            keyframe.stamp_ns, keyframe.session, np.eye(4) if T is None else T, keyframe.travelled, keyframe.robot
        )


class Statement(NamedTuple):
    """The best pose ``T_target_source (4, 4)`` of a pair of keyframes, and the ``odds`` that it is right.

    ``sure`` where the gate accepts it by itself, ``by_odometry`` where that says where both keyframes were. The pose is
    known to ``rotation_deg`` and ``translation_m`` (root mean square).
    """

    source: Standpoint
    target: Standpoint
    T_target_source: Array
    odds: float
    sure: bool
    by_odometry: bool = True
    rotation_deg: float = 0.0
    translation_m: float = 0.0

    @property
    def weight(self) -> float:
        """The probability that it is right."""
        return self.odds / (1.0 + self.odds)


class Support(NamedTuple):
    """What other statements say of one.

    ``agreeing`` counts those that agree with it and with each other, each of two keyframes of its own, one of them
    ``sure`` or it itself is. Of all that concern the same place, weighing ``received``, ``share`` agrees. What
    disagrees by no more than odometry jitters is left out.
    """

    agreeing: int
    share: float
    received: float


class Excess(NamedTuple):
    """How far the difference of two poses is beyond what those that agree may differ by; at most 0 where they agree."""

    rotation_deg: float
    translation_m: float

    def is_beyond(self, allowance: Jitter) -> bool:
        """Whether jitter of odometry does not excuse it either."""
        most_deg, most_m = allowance
        disagrees = self.rotation_deg > 0.0 or self.translation_m > 0.0
        return disagrees and (self.rotation_deg > most_deg or self.translation_m > most_m)


class Consistency:
    """The statements of late, by number, and which of them agree."""

    def __init__(self) -> None:
        self._statements: dict[int, Statement] = {}
        self._agree: dict[int, set[int]] = {}
        self._near: dict[int, dict[int, Excess]] = {}
        self._next, self._meter = 0, JitterMeter()

    def __len__(self) -> int:
        return len(self._statements)

    def __contains__(self, number: int) -> bool:
        return number in self._statements

    @property
    def jitter(self) -> Jitter:
        """Of odometry, as measured until now."""
        return self._meter.jitter

    def add_statement(self, statement: Statement) -> int:
        """Take in a statement; its number. Forgets what no later one can concern any more."""
        self._forget(statement.source)
        number, self._next = self._next, self._next + 1
        others = [n for n, other in self._statements.items() if _same_sessions(other, statement)]
        known = [self._statements[n] for n in others]
        metres = np.array([path_m(other, statement) for other in known])
        differences = differences_of(known, statement)
        self._measure(known, statement, metres, differences)
        self._statements[number] = statement
        self._link(number, others, metres, differences)
        return number

    def _link(self, number: int, others: Sequence[int], metres: Array, differences: Array) -> None:
        """Note which others a statement agrees with, and how far it is from those that are near."""
        excess = differences - tolerance(metres)
        agrees, near = _within(excess, metres), metres <= NEAR_M
        self._agree[number] = {n for n, yes in zip(others, agrees, strict=True) if yes}
        beyond = zip(others, map(Excess._make, excess.tolist()), near, strict=True)
        self._near[number] = {n: by for n, by, yes in beyond if yes}
        for n in self._agree[number]:
            self._agree[n].add(number)
        for n, by in self._near[number].items():
            self._near[n][number] = by

    def support(self, number: int) -> Support:
        """What the others say of a statement that is still known."""
        near, allowance = self._near[number], self.jitter.allowance()
        agreeing = sum(self._statements[n].weight for n in near if n in self._agree[number])
        opposing = sum(self._statements[n].weight for n, excess in near.items() if excess.is_beyond(allowance))
        weight = agreeing + opposing
        return Support(self._clique(number), agreeing / weight if weight > 0.0 else 0.0, weight)

    def _measure(self, others: Sequence[Statement], one: Statement, metres: Array, differences: Array) -> None:
        """Learn how far odometry jitters where both poses are sure."""
        near = [k for k, path in enumerate(metres) if path <= MEASURED_M and _measures(others[k])]
        if near and _measures(one):
            sure, noise = [others[k] for k in near], tolerance(metres[near]) / TOLERANCE_SIGMAS
            explained = np.array([variances(other, one) for other in sure]) + np.square(noise)
            self._meter.add_differences(
                differences[near], explained, np.array([ends_between(other, one) for other in sure])
            )

    def _clique(self, number: int) -> int:
        """How many others agree with a statement and each other, the surest first; 0 where none of them all is sure.

        Only likely ones count, and of two of one keyframe one.
        """
        likely = [n for n in self._agree[number] if self._statements[n].odds >= 1.0]
        clique = [number]
        for n in sorted(likely, key=lambda n: (not self._statements[n].sure, -self._statements[n].odds, n)):
            if all(n in self._agree[m] and self._distinct(n, m) for m in clique):
                clique.append(n)
        return len(clique) - 1 if any(self._statements[n].sure for n in clique) else 0

    def _distinct(self, a: int, b: int) -> bool:
        one, other = self._statements[a], self._statements[b]
        return (one.source.stamp_ns != other.source.stamp_ns) and (one.target.stamp_ns != other.target.stamp_ns)

    def _forget(self, now: Standpoint) -> None:
        """Leave out what is beyond reach of the camera, and the oldest of too many."""
        gone = [
            n
            for n, one in self._statements.items()
            if one.source.session != now.session or now.travelled - one.source.travelled > REACH_M
        ]
        gone += list(self._statements)[: max(len(self._statements) + 1 - MOST - len(gone), 0)]
        self._leave_out(gone)

    def forget_where(self, is_meant: Callable[[Statement], bool]) -> None:
        """Leave out statements for which ``is_meant`` is true: they agree with nothing and oppose nothing any more."""
        self._leave_out([n for n, one in self._statements.items() if is_meant(one)])

    def _leave_out(self, gone: Iterable[int]) -> None:
        for n in dict.fromkeys(gone):
            self.remove_statement(n)

    def remove_statement(self, number: int) -> None:
        """Forget a statement that is still known; one that is not is passed over."""
        if self._statements.pop(number, None) is None:
            return
        for m in self._agree.pop(number):
            self._agree[m].discard(number)
        for m in self._near.pop(number):
            del self._near[m][number]


def _same_sessions(one: Statement, other: Statement) -> bool:
    return (one.source.session, one.target.session) == (other.source.session, other.target.session)


def path_m(one: Statement, other: Statement) -> float:
    """The camera's path from one pair of keyframes to the other, at both ends together."""
    source = abs(one.source.travelled - other.source.travelled)
    return source + abs(one.target.travelled - other.target.travelled)


def agree(others: Sequence[Statement], one: Statement, metres: Array) -> Array:
    """(N,) bool: whether odometry carries the pose of ``one`` to where each of ``others`` is, or back."""
    return _within(differences_of(others, one) - tolerance(metres), metres)


def _within(excess: Array, metres: Array) -> Array:
    return np.asarray((metres <= REACH_M) & (excess <= 0.0).all(axis=1))


def _measures(one: Statement) -> bool:
    return one.sure and one.by_odometry


def variances(one: Statement, other: Statement) -> tuple[float, float]:
    """The variance of the difference of two poses, in degrees and metres squared, by what both are unsure of."""
    return one.rotation_deg**2 + other.rotation_deg**2, one.translation_m**2 + other.translation_m**2


def ends_between(one: Statement, other: Statement) -> int:
    """How many poses of odometry carry one pose to the other: that of a keyframe that both share cancels out."""
    shared = (one.source.stamp_ns == other.source.stamp_ns) + (one.target.stamp_ns == other.target.stamp_ns)
    return ENDS - 2 * shared


def tolerance(metres: Array) -> Array:
    """(N, 2) degrees and metres by which poses that agree may differ over so much path."""
    growth = np.array([ROTATION_GROWTH_DEG_M, TRANSLATION_GROWTH])
    return np.asarray(np.array([ROTATION_DEG, TRANSLATION_M]) + growth * metres[:, None])


def differences_of(others: Sequence[Statement], one: Statement) -> Array:
    """(N, 2) degrees and metres between the pose of each of ``others`` and that of ``one``, carried by odometry.

    Carried there or back: the less of both distances.
    """
    if not others:
        return np.zeros((0, 2))
    T_there = np.array([other.target.T_session_camera for other in others])
    T_here = np.array([other.source.T_session_camera for other in others])
    T_others = np.array([other.T_target_source for other in others])
    T_target, T_source = one.target.T_session_camera, one.source.T_session_camera
    forth = np.linalg.inv(T_there) @ T_target @ one.T_target_source @ inverse(T_source) @ T_here
    back = inverse(T_target) @ T_there @ T_others @ np.linalg.inv(T_here) @ T_source
    cosine = (np.sum(forth[:, :3, :3] * T_others[:, :3, :3], axis=(1, 2)) - 1.0) / 2.0
    degrees = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    apart = np.linalg.norm(forth[:, :3, 3] - T_others[:, :3, 3], axis=1)
    apart = np.minimum(apart, np.linalg.norm(back[:, :3, 3] - one.T_target_source[:3, 3], axis=1))
    return np.stack((degrees, apart), axis=1)
