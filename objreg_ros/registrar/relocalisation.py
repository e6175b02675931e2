# SPDX-License-Identifier: Apache-2.0
"""Where the camera is in the map of an earlier session: the frame that the poses of its keyframes are in.

A closure to a keyframe of an earlier session ties the odometry of now to that map. One alone is believed where its odds
are high or other keyframes confirmed it; else two must agree by way of odometry (`consistency`). What agrees is
averaged by its information on SE(3), where the camera of the newest was (Barfoot and Furgale, "Associating uncertainty
with three-dimensional poses for use in estimation problems", 2014). From there odometry goes on.
"""

from __future__ import annotations

import threading
from collections import Counter, deque
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure, Relocalised
from objreg_ros.data.frames import Frame
from objreg_ros.geometry import inverse, pose, rigid, rotation_from_vector, turned_about, vector_from_rotation
from objreg_ros.keyframes.keyframer import SILENCE_S
from objreg_ros.keyframes.odometry import TravelledPath
from objreg_ros.registrar.confirmation import SUPPORTERS
from objreg_ros.registrar.consistency import (
    NEAR_M,
    ROTATION_GROWTH_DEG_M,
    TRANSLATION_GROWTH,
    Standpoint,
    Statement,
    agree,
    path_m,
)
from objreg_ros.registration.keyframe import Keyframe

ALONE_ODDS = 1000.0  # of a closure that is believed by itself
MOST = 64  # ties that are kept, the newest
STEP = 0.05, 3.0  # m, degrees: less is no motion, but the noise of odometry
MOST_STEPS = 4096  # of the path that are kept: a search of a keyframe ends later than the camera moves on
ROUNDS = 4  # of averaging rotations: the mean of poses that agree has settled by then


class SessionTie(NamedTuple):
    """A closure to an earlier session, with the ``covariance`` (6, 6) of its pose."""

    statement: Statement
    covariance: Array
    confirmed: bool
    by_odometry: bool

    @property
    def T_map_odom(self) -> Array:
        """(4, 4) from the odometry of now into the earlier session's."""
        one = self.statement
        return one.target.T_session_camera @ one.T_target_source @ inverse(one.source.T_session_camera)

    @property
    def moments(self) -> tuple[int, int, int, int]:
        """Session and stamp of the earlier keyframe, and of the later."""
        target, source = self.statement.target, self.statement.source
        return target.session, target.stamp_ns, source.session, source.stamp_ns

    def carried(self, here: Standpoint, metres: float) -> tuple[Array, Array]:
        """The camera ``here`` in the map (4, 4) by this tie and odometry, and the covariance of that (6, 6).

        ``metres`` is the path from the tie to there, in both sessions together: the earlier one has drifted too.
        """
        one = self.statement
        T_map_here = self.T_map_odom @ here.T_session_camera
        R = np.kron(np.eye(2), one.target.T_session_camera[:3, :3])
        at = one.target.T_session_camera @ one.T_target_source
        covariance = turned_about(R @ self.covariance @ R.T, T_map_here[:3, 3] - at[:3, 3])
        return T_map_here, covariance + drift(metres)


def drift(metres: float) -> Array:
    """The covariance (6, 6) of so much path by odometry: what `consistency` allows is two deviations."""
    sigma = 0.5 * metres * np.array([TRANSLATION_GROWTH] * 3 + [np.radians(ROTATION_GROWTH_DEG_M)] * 3)
    return np.diag(sigma**2)


class Relocalisation:
    """Follows every frame and every closure; `relocalised` says where the camera is, `reason` why that is not known.

    It stays with the session in whose map it was sure first. All is forgotten where odometry begins anew, or may have
    in a silence. For several threads.
    """

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._last_ns = 0
        self._begin(-1, 0)

    def _begin(self, session: int, began_ns: int) -> None:
        """Forget everything: the frames from ``began_ns`` on are in odometry of their own."""
        self._session, self._began_ns = session, began_ns
        self._came: list[SessionTie] = []  # all of them
        self._ties: list[SessionTie] = []  # those that count
        self._received = Counter[int]()  # closures, by the earlier session
        self._camera: tuple[int, Array] | None = None  # the newest: stamp and T_odom_camera
        self._map: int | None = None  # the session in whose map the camera is
        self._T_map_odom: Array = np.eye(4)
        self._covariance: Array = np.eye(6)  # of the camera where the last tie was
        self._origin: Array = np.zeros(3)  # of that, in odometry
        self._path = TravelledPath(np.eye(4))
        self._steps = deque([(began_ns, 0.0)], maxlen=MOST_STEPS)  # stamp, and the path until then
        self._path_until_tie = 0.0
        self._agreeing, self._target_ns, self._by_odometry = 0, 0, False
        self._unfused: list[tuple[SessionTie, float]] = []  # ties that agree, and the path to each

    @property
    def newest_ns(self) -> int:
        """The stamp of the newest frame, 0 before the first."""
        return self._last_ns

    def note_frame(self, frame: Frame, session: int) -> None:
        """Go on to a frame of this session."""
        with self._lock:
            silent_s = 1e-9 * (frame.stamp_ns - self._last_ns)
            if session == self._session and silent_s <= 0.0:  # late: passed over
                return
            self._last_ns = frame.stamp_ns
            if session != self._session or silent_s > SILENCE_S:
                self._begin(session, frame.stamp_ns)
            if frame.T_odom_camera is not None:
                self._go(frame.stamp_ns, frame.T_odom_camera)

    def _go(self, stamp_ns: int, T_odom_camera: Array) -> None:
        self._camera = stamp_ns, T_odom_camera
        if not self._path.is_near(T_odom_camera, *STEP):
            self._path.go(T_odom_camera)
            self._steps.append((stamp_ns, self._path.travelled))

    def _path_until(self, stamp_ns: int) -> float:
        """Metres from the first frame to a stamp, or to the earliest step that is kept."""
        before = (metres for step_ns, metres in reversed(self._steps) if step_ns <= stamp_ns)
        return next(before, self._steps[0][1])

    def add_closure(self, closure: LoopClosure, source: Keyframe, target: Keyframe) -> None:
        """Take in a closure of these keyframes, the later one first; those of one session add nothing."""
        with self._lock:
            is_of_now = source.session == self._session and source.stamp_ns >= self._began_ns
            if not is_of_now or target.session >= source.session:
                return
            if self._camera is None or not source.by_odometry:  # our own tracking gives no pose between keyframes
                self._go(source.stamp_ns, _pose_of(source))
            self._received[target.session] += 1
            tie = _tie(closure, source, target)
            self._came = [*self._came, tie][-MOST:]
            self._take_in(tie)

    def withdraw(self, closures: Iterable[LoopClosure]) -> None:
        """Answer as if these closures had never come."""
        gone = {(one.from_session, one.from_ns, one.to_session, one.to_ns) for one in closures}
        with self._lock:
            left_out = [tie for tie in self._came if tie.moments in gone]
            if left_out:
                self._received -= Counter(tie.statement.target.session for tie in left_out)
                self._came = [tie for tie in self._came if tie.moments not in gone]
                self._renew([tie for tie in self._ties if tie.moments not in gone])

    @contextmanager
    def beginning_again(self) -> Iterator[list[SessionTie]]:
        """Forget the answer, and give all ties that came, also of before the camera was taken elsewhere.

        `take_in` counts them anew; no other thread sees what it is meanwhile.
        """
        with self._lock:
            self._renew([])
            yield self._came

    def take_in(self, tie: SessionTie) -> None:
        """Count a tie, after those of before."""
        with self._lock:
            self._take_in(tie)

    def _take_in(self, tie: SessionTie) -> None:
        self._weigh(tie)
        self._ties = [*self._ties, tie][-MOST:]

    def _renew(self, ties: Iterable[SessionTie]) -> None:
        """Answer by these ties alone."""
        self._map, self._ties = None, []
        for tie in ties:
            self._take_in(tie)

    def _weigh(self, tie: SessionTie) -> None:
        """Renew the answer with a tie, if it is believed."""
        target = tie.statement.target.session
        if self._map not in (None, target):
            return
        others = [one for one in self._ties if one.statement.target.session == target]
        statements = [one.statement for one in others]
        metres = np.array([path_m(one, tie.statement) for one in statements])
        agrees = agree(statements, tie.statement, metres)
        agreeing = [(one, float(way)) for one, way, yes in zip(others, metres, agrees, strict=True) if yes]
        supporters = sum(_distinct(one.statement, tie.statement) for one, _ in agreeing)
        opponents = int(np.sum((metres <= NEAR_M) & ~agrees))
        alone = tie.confirmed or tie.statement.odds >= ALONE_ODDS
        if supporters + alone <= opponents:
            return
        self._map, self._agreeing, self._target_ns = target, 1 + len(agreeing), tie.statement.target.stamp_ns
        self._by_odometry = tie.by_odometry
        self._unfused = [*agreeing, (tie, 0.0)]

    def _fuse(self) -> None:
        """Average the ties that agree, if that is not done: who weighs many anew asks for few of the answers."""
        if not self._unfused:
            return
        here = self._unfused[-1][0].statement.source
        T_map_here, self._covariance = fused([one.carried(here, way) for one, way in self._unfused])
        self._T_map_odom = rigid(T_map_here @ inverse(here.T_session_camera))
        self._origin, self._path_until_tie = here.T_session_camera[:3, 3], self._path_until(here.stamp_ns)
        self._unfused = []

    def begin_at(self, first_ns: int) -> None:
        """Forget ties to earlier sessions of keyframes before ``first_ns``: the camera was taken elsewhere by then.

        What is left ties it anew, where that suffices.
        """
        with self._lock:
            self._renew([one for one in self._ties if one.statement.source.stamp_ns >= first_ns])

    @property
    def relocalised(self) -> Relocalised | None:
        """Where the newest frame's camera is; None where it is not known."""
        with self._lock:
            return None if self._camera is None else self._where(*self._camera, self._path.travelled)

    def relocalised_at(self, here: Standpoint) -> Relocalised | None:
        """Where the camera was at an earlier keyframe of this session; None where it is not known."""
        with self._lock:
            return self._where(here.stamp_ns, here.T_session_camera, self._path_until(here.stamp_ns))

    def _where(self, stamp_ns: int, T_odom_camera: Array, travelled: float) -> Relocalised | None:
        """Where a camera is that odometry has come to after so many metres."""
        if self._map is None:
            return None
        self._fuse()
        way = self._T_map_odom[:3, :3] @ (T_odom_camera[:3, 3] - self._origin)
        return Relocalised(
            stamp_ns=stamp_ns,
            session=self._map,
            target_ns=self._target_ns,
            T_map_odom=self._T_map_odom,
            T_map_camera=self._T_map_odom @ T_odom_camera,
            covariance=turned_about(self._covariance, way) + drift(travelled - self._path_until_tie),
            closures=self._agreeing,
            by_odometry=self._by_odometry,
        )

    @property
    def reason(self) -> str:
        """Why it is not known, or by how many closures it is."""
        with self._lock:
            if self._map is not None:
                return f"{self._agreeing} closures that agree, to session {self._map}"
            if not self._received:
                return "no closure to an earlier session yet"
            received = ", ".join(f"{count} to session {session}" for session, count in sorted(self._received.items()))
            return f"closures so far: {received}; expected two that agree, or one with odds of {ALONE_ODDS:g}"


def fused(poses: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    """The mean of poses (4, 4) with covariances (6, 6), weighted by their information, and its covariance."""
    information = [np.linalg.inv(covariance) for _, covariance in poses]
    covariance = np.linalg.inv(sum(information))
    T = poses[-1][0]
    for _ in range(ROUNDS):
        apart = [
            weight @ np.concatenate([one[:3, 3] - T[:3, 3], vector_from_rotation(one[:3, :3] @ T[:3, :3].T)])
            for weight, (one, _) in zip(information, poses, strict=True)
        ]
        step = covariance @ sum(apart)
        T = pose(rotation_from_vector(step[3:]) @ T[:3, :3], T[:3, 3] + step[:3])
    return T, np.asarray(0.5 * (covariance + covariance.T))


def _tie(closure: LoopClosure, source: Keyframe, target: Keyframe) -> SessionTie:
    odds = closure.evidence.get("odds", 0.0)
    confirmed = closure.evidence.get("agreeing", 0.0) >= SUPPORTERS
    statement = Statement(Standpoint.of(source), Standpoint.of(target), closure.T_from_to, odds, True)
    return SessionTie(statement, closure.covariance, confirmed, source.by_odometry and target.by_odometry)


def _distinct(one: Statement, other: Statement) -> bool:
    """Whether two are of two keyframes each: those of one see the same, and err together."""
    return one.source.stamp_ns != other.source.stamp_ns and one.target.stamp_ns != other.target.stamp_ns


def _pose_of(keyframe: Keyframe) -> Array:
    return np.eye(4) if keyframe.T_odom_camera is None else keyframe.T_odom_camera
