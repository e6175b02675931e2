# SPDX-License-Identifier: Apache-2.0
"""Follows one camera: is it where odometry says, or elsewhere?

For every keyframe it compares the known objects with the view, and for every closure the pose with the tie of its
session. Closures that contradict odometry and agree with each other say where the camera is instead.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure, Relocalised
from objreg_ros.data.localisation import LocalisationState
from objreg_ros.memory.known import Last
from objreg_ros.memory.sighting import Sighting
from objreg_ros.registrar.consistency import Standpoint, Statement
from objreg_ros.registrar.localisation.belief import Belief
from objreg_ros.registrar.localisation.contradiction import Says, Tied, difference, in_agreement, says
from objreg_ros.registrar.localisation.expectation import Look, Place, looks_of
from objreg_ros.registrar.localisation.memory import OLD_NS, Familiar
from objreg_ros.registrar.localisation.places import places_of, shown_by, sigma_of
from objreg_ros.registrar.localisation.verdict import Standing, reason_of, state_of
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.relocalisation import ALONE_ODDS, Relocalisation, drift
from objreg_ros.registrar.vetoes import Vetoes
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.labels import LabelGroups

# How often a known object in the picture is so, of a camera that is where odometry says and of one that is elsewhere.
# Rounded guesses beside few counts: seen where odometry is right are 0.8 (a simulated room), 0.6 (KITCHEN), 0.3 (RPY),
# elsewhere 0.3 (KITCHEN); looked through none of 1300, elsewhere 4 of 62. `KEYFRAME` and `UNSEEN_ODDS` keep them small.
LOOKS = {Look.SEEN: (0.7, 0.2), Look.MISSING: (0.02, 0.06), Look.NOTHING: (0.28, 0.74), Look.OUTSIDE: (1.0, 1.0)}
KEYFRAME = math.log(5.0)  # what all looks of a keyframe say together at most: they err together
UNSEEN_ODDS = 0.3  # to which objects that are not detected can raise the odds: a detector may fail for long
CONTRADICTS = 0.5  # of right closures of a camera that is elsewhere, so many contradict odometry by enough
AGREE = 10.0  # so much likelier do right poses of two keyframes agree than false ones, at least
DOUBTFUL_ODDS = 0.01  # of being elsewhere, from which the session is searched without odometry
RIVALS = 32  # poses that contradict odometry that are kept, the newest
MOST_CAME = 256  # closures and such poses that are kept, the newest: a person may withdraw one
EXPECTED = 1000  # landmarks, the newest, that are expected
SHOWN_NS = 3_000_000_000  # for so long it is said that the camera was kidnapped: who looks once a second must see it


class Came(NamedTuple):
    """What a ``closure`` says, or a pose that was found without odometry, where that is None.

    By odometry the camera turned ``turn_deg`` between the two keyframes.
    """

    statement: Statement
    turn_deg: float
    closure: LoopClosure | None

    @property
    def moments(self) -> tuple[int, int, int, int]:
        """As those of `SessionTie`."""
        target, source = self.statement.target, self.statement.source
        return target.session, target.stamp_ns, source.session, source.stamp_ns

    def is_withdrawn(self, vetoes: Vetoes) -> bool:
        """Whether a person did: a closure itself, of poses those that say the same too."""
        if self.closure is not None:
            return self.closure in vetoes
        return vetoes.covers(self.statement.source, self.statement.target, self.statement.T_target_source)


class Localisation:
    """What is known of the camera whose ``relocalisation`` this is. For several threads."""

    def __init__(self, params: RegistrarParams, relocalisation: Relocalisation) -> None:
        self._params, self._relocalisation = params, relocalisation
        self._groups, self._lock = LabelGroups(params.label_groups), threading.RLock()
        self._begin(-1, 0)

    def _begin(self, session: int, stamp_ns: int) -> None:
        self._session, self._began_ns, self._familiar = session, stamp_ns, Familiar()
        self._came = deque[Came](maxlen=MOST_CAME)
        self._alike = ""
        self._linked = True  # the newest keyframe, to what counts
        self._forget_evidence()

    def _forget_evidence(self) -> None:
        """Believe what is believed of a camera of which nothing came yet."""
        self._belief = Belief()
        self._belief.wait(self._began_ns)
        self._missing: set[int] = set()  # landmarks
        self._rivals: list[Statement] = []  # that contradict odometry, since one that agrees
        self._before: Relocalised | None = None  # the tie before them
        self._closure: LoopClosure | None = None
        self._target_travelled = math.nan
        self._agreed_ns = -1  # the newest keyframe of which a closure to an older place agrees with odometry
        self._since_ns, self._moved_ns, self._kidnapped = self._began_ns, self._began_ns, ""

    @property
    def is_doubtful(self) -> bool:
        """Whether it is worth a search that does not believe odometry: nothing of the newest keyframe confirms it."""
        return not self._linked or (self._belief.odds >= DOUBTFUL_ODDS and bool(self._missing or self._rivals))

    @property
    def since_ns(self) -> int:
        """Keyframes of the session before this are in odometry that has been found wrong since."""
        return self._since_ns

    def sessions(self) -> frozenset[int]:
        """Those whose objects are expected: the camera's own, and that of the map."""
        tied = self._tied()
        return frozenset({self._session} if tied is None else {self._session, tied.session})

    def expect(self, keyframe: Keyframe, known: Iterable[tuple[int, Last, int]]) -> list[tuple[Place, Look]]:
        """Compare known objects, as they were before it, with a keyframe; what it showed of each."""
        with self._lock:
            if keyframe.session != self._session:
                self._begin(keyframe.session, keyframe.stamp_ns)
                self._belief.wait(keyframe.stamp_ns)
                return []
            self._belief.wait(keyframe.stamp_ns)
            if not keyframe.by_odometry or keyframe.T_odom_camera is None:
                return []
            places = places_of(known, keyframe, self._tied(), self._since_ns, self._params)
            looks = looks_of(places, shown_by(keyframe, self._groups), keyframe.view)
            found = list(zip(places, looks, strict=True))
            self._linked = self._weigh(found, keyframe.stamp_ns)
            return found

    def _weigh(self, found: Sequence[tuple[Place, Look]], stamp_ns: int) -> bool:
        """Weigh what is shown of objects; whether at least half of them say that it is where odometry says."""
        looks = {place.landmark: look for place, look in found if self._says_something(place.landmark, look, stamp_ns)}
        new = {landmark for landmark, look in looks.items() if look is Look.MISSING} - self._missing
        seen = {landmark for landmark, look in looks.items() if look is Look.SEEN}
        self._missing = (self._missing | new) - seen
        log_ratio = sum(ratio(look) for look in looks.values())
        most = math.inf if new else UNSEEN_ODDS
        self._belief.weigh(min(max(log_ratio, -KEYFRAME), KEYFRAME), most)
        return bool(seen) and 2 * len(seen) >= len(looks)

    def _says_something(self, landmark: int, look: Look, stamp_ns: int) -> bool:
        """What is missed says so but once."""
        if look is Look.SEEN:
            return self._familiar.counts(landmark, stamp_ns)
        return look is Look.NOTHING or (look is Look.MISSING and landmark not in self._missing)

    def see(self, named: Sequence[Sighting]) -> None:
        """Take in the objects of the keyframe under their landmarks, after its closures."""
        with self._lock:
            if named and named[0].session == self._session:
                stamp_ns = named[0].stamp_ns
                self._linked |= stamp_ns in (self._since_ns, self._agreed_ns)
                self._familiar.see((one.landmark for one in named), stamp_ns, self._linked)

    def set_alike(self, why: str) -> None:
        """A keyframe without a closure fits two places of a map, if ``why`` says so; until a closure to a map comes."""
        with self._lock:
            self._alike = why or self._alike

    def add_closure(self, closure: LoopClosure, source: Keyframe, target: Keyframe) -> None:
        """Take in a closure, the later keyframe first, before the relocalisation does."""
        if source.session == self._session != target.session:
            self._alike = ""
        odds = closure.evidence.get("odds", 1.0)
        self._add(source, target, closure.T_from_to, odds, closure)

    def add_rival(self, source: Keyframe, target: Keyframe, T_target_source: object, odds: float) -> None:
        """Take in a pose that was found without odometry, in the camera's own session."""
        self._add(source, target, np.asarray(T_target_source), odds, None)

    def _add(self, source: Keyframe, target: Keyframe, T: Array, odds: float, closure: LoopClosure | None) -> None:
        with self._lock:
            if source.session == self._session:
                self._came.append(_came(source, target, T, odds, closure))
                self._state(self._came[-1])

    def withdraw(self, vetoes: Vetoes) -> None:
        """Take back what a person withdrew, after the relocalisation did."""
        with self._lock:
            kept = [came for came in self._came if not came.is_withdrawn(vetoes)]
            if len(kept) < len(self._came):
                self._weigh_anew(kept)

    def admit(self, closure: LoopClosure, source: Keyframe, target: Keyframe) -> None:
        """Take in a closure that holds again, after the relocalisation did."""
        with self._lock:
            if source.session == self._session:
                came = _came(source, target, closure.T_from_to, closure.evidence.get("odds", 1.0), closure)
                self._weigh_anew(sorted((*self._came, came), key=lambda one: one.statement.source.stamp_ns))

    def _weigh_anew(self, kept: Sequence[Came]) -> None:
        """Go through what came since the session began once more.

        What views showed is left out: objects were looked for by the tie of then.
        """
        self._came = deque(kept, MOST_CAME)
        self._forget_evidence()
        with self._relocalisation.beginning_again() as came:
            ties, names = {tie.moments: tie for tie in came}, {one.moments for one in self._came}
            for moments in [
                one for one in ties if one not in names
            ]:  # of so long ago that only the relocalisation has them
                self._relocalisation.take_in(ties.pop(moments))
            for one in self._came:
                self._belief.wait(one.statement.source.stamp_ns)
                self._state(one)
                if one.moments in ties:
                    self._relocalisation.take_in(ties.pop(one.moments))

    def _state(self, came: Came) -> None:
        one, closure = came.statement, came.closure
        source, target = one.source, one.target
        if source.stamp_ns < self._moved_ns:
            return
        tied = self._tied_to(came)
        if tied is None:
            if target.session != source.session and self._tied_at(source) is None:  # the first: nothing to compare with
                self._closure, self._target_travelled = closure, target.travelled
            return
        if self._rivals and source.session == target.session and target.stamp_ns >= self._rivals[0].source.stamp_ns:
            return  # if the camera was taken away, both keyframes came after that
        apart = difference(one, tied)
        match says(apart, tied):
            case Says.HERE:
                self._agrees(one, closure)
            case Says.ELSEWHERE:
                self._contradicts(one)
            case Says.BESIDE:
                pass

    def _agrees(self, one: Statement, closure: LoopClosure | None) -> None:
        """A closure that says nothing else than odometry does; of what came shortly before it says nothing more."""
        self._closure, self._target_travelled = closure or self._closure, one.target.travelled
        if one.target.session == one.source.session and one.source.stamp_ns - one.target.stamp_ns < OLD_NS:
            return  # the camera may have been taken away before both
        self._agreed_ns = one.source.stamp_ns
        self._belief.weigh(-math.log(min(max(one.odds, 1.0), ALONE_ODDS)))
        self._rivals, self._before = [], None

    def _contradicts(self, one: Statement) -> None:
        """A closure that puts the camera elsewhere; two of them that agree have it taken there."""
        self._before = self._tied_at(one.source)
        is_first = one.source.stamp_ns not in {other.source.stamp_ns for other in self._rivals}
        self._rivals = [*self._rivals, one][-RIVALS:]
        same = in_agreement(self._rivals)
        if is_first:  # those of one keyframe err together
            weight = CONTRADICTS * min(one.odds, ALONE_ODDS) * (AGREE if same else 1.0)
            self._belief.weigh(math.log(max(weight, 1.0)))
        if same and self._belief.odds >= 1.0:
            self._move(same)

    def _move(self, same: Sequence[Statement]) -> None:
        """Go on from where the closures ``same`` have the camera."""
        newest, tied = same[-1], self._tied_to_session(same[-1])
        metres = difference(newest, tied).metres if tied is not None else math.nan
        ids = f"{len(same)} closures that agree put the camera {metres:.2f} m from where odometry has it"
        self._kidnapped = f"{ids}, with odds of {', '.join(f'{one.odds:.0f}' for one in same)}"
        first_ns = min(one.source.stamp_ns for one in same)
        self._since_ns, self._moved_ns = first_ns, newest.source.stamp_ns
        self._relocalisation.begin_at(first_ns)
        self._rivals, self._before, self._missing, self._familiar = [], None, set(), Familiar()
        self._target_travelled = newest.target.travelled
        self._belief.settle(math.prod(max(one.odds, 1.0) for one in same))

    def _tied(self) -> Relocalised | None:
        """The tie to a map, as it was before closures contradicted it."""
        return self._before or self._relocalisation.relocalised

    def _tied_at(self, here: Standpoint) -> Relocalised | None:
        """As `_tied`, where the camera was at a keyframe."""
        return self._before or self._relocalisation.relocalised_at(here)

    def _tied_to_session(self, one: Statement) -> Tied | None:
        if one.target.session == one.source.session:
            return Tied(np.eye(4), 0.0, 0.0)
        tied = self._tied_at(one.source)
        return None if tied is None else Tied(tied.T_map_odom, 0.0, 0.0)

    def _tied_to(self, came: Came) -> Tied | None:
        """What is believed of the source in the target's session; None where nothing is."""
        source, target = came.statement.source, came.statement.target
        if source.session == target.session:
            if not came.statement.by_odometry or target.stamp_ns < self._since_ns:
                return None
            path, p = abs(source.travelled - target.travelled), self._params
            return Tied(
                np.eye(4),
                p.odometry_translation_noise + p.odometry_drift * path,
                p.odometry_rotation_noise + p.odometry_rotation_drift * came.turn_deg,
            )
        tied = self._tied_at(source)
        if tied is None or tied.session != target.session:
            return None
        way = 0.0 if math.isnan(self._target_travelled) else abs(target.travelled - self._target_travelled)
        covariance = tied.covariance + drift(way)
        sigma_deg = math.degrees(math.sqrt(float(np.trace(covariance[3:, 3:])) / 3.0))
        return Tied(tied.T_map_odom, math.sqrt(float(np.trace(covariance[:3, :3])) / 3.0), sigma_deg)

    def state(self, stamp_ns: int) -> LocalisationState:
        """The state at the newest frame."""
        with self._lock:
            self._belief.wait(stamp_ns)
            if stamp_ns - self._moved_ns > SHOWN_NS:
                self._kidnapped = ""
            tied = self._relocalisation.relocalised
            now = Standing(
                elsewhere=self._belief.probability,
                sigma_m=math.nan if tied is None else sigma_of(tied),
                age_s=math.nan if self._closure is None else 1e-9 * max(stamp_ns - self._closure.to_ns, 0),
                missing=len(self._missing),
                contradicting=len(self._rivals),
                kidnapped=self._kidnapped,
                alike=self._alike,
            )
            return LocalisationState(
                stamp_ns=stamp_ns,
                state=state_of(now),
                reason=reason_of(now),
                age_s=now.age_s,
                odds=1.0 / self._belief.odds,
                probability=now.probability,
                sigma_m=now.sigma_m,
                closure=self._closure,
            )


def _came(source: Keyframe, target: Keyframe, T: Array, odds: float, closure: LoopClosure | None) -> Came:
    by_odometry = source.by_odometry and target.by_odometry
    statement = Statement(Standpoint.of(source), Standpoint.of(target), T, odds, True, by_odometry)
    return Came(statement, abs(source.turned - target.turned), closure)


def ratio(look: Look) -> float:
    """The log of how much likelier a look is of a camera that is elsewhere."""
    here, elsewhere = LOOKS[look]
    return math.log(elsewhere / here)
