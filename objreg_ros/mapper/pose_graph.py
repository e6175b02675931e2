# SPDX-License-Identifier: Apache-2.0
"""The map that a user sees: keyframes out of odometry, tied together by closures."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from objreg_ros.data import Array, LoopClosure, Odometry
from objreg_ros.geometry import inverse, is_rigid
from objreg_ros.mapper.constraint import Constraint, between_keyframes, floored
from objreg_ros.mapper.pairwise import PairwiseConsistency
from objreg_ros.mapper.params import MapperParams
from objreg_ros.mapper.session import Session, stacked
from objreg_ros.mapper.solver import Course, End, Problem, Solution, Solver, Tie
from objreg_ros.mapper.sparse import SparseTrajectory
from objreg_ros.mapper.trajectory import Trajectory

SLACK_M = 1.0  # that a closure may lead farther than any way: odometry at rest trembles, and is not the camera
VAGUEST = 1e12  # m^2 and rad^2: ROS says "unknown" by less; what is known no better tells nothing


@dataclass(frozen=True, slots=True)
class Summary:
    """What an optimisation came to: the closures that it kept, and those that it pruned, and with what ``residuals``.

    These are of the pruned ones, in standard deviations.
    """

    kept: tuple[LoopClosure, ...] = ()
    pruned: tuple[LoopClosure, ...] = ()
    residuals: tuple[float, ...] = ()


class ImplausibleError(ValueError):
    """A closure claims what cannot be: a way that no body went, or a pose of which nothing is known."""


class PoseGraph:
    """Sessions of odometry and the closures between their moments; `optimise` makes them agree.

    The map's frame is that of the first session's odometry at its beginning. Another session is in it once closures tie
    it there. What is asked of the graph without a session is asked of the newest, in which odometry goes on.
    """

    def __init__(self, params: MapperParams | None = None) -> None:
        self.params = params or MapperParams()
        self.sessions = [Session()]
        self._closures: list[Tie] = []
        self._withdrawn: set[int] = set()
        self._solver, self._pairwise = Solver(), PairwiseConsistency()
        self._solution = Solution((), np.zeros(0, bool), np.zeros(0))
        self._T_map_odom = np.eye(4)

    # What comes in

    def begin_session(self, name: int | None = None) -> None:
        """Odometry from now on is of another run; nothing ties it to the runs before."""
        if len(self.sessions[-1].keyframes) == 0:
            self.sessions.pop()
        self.sessions.append(Session())
        self._name(len(self.sessions) - 1, name)
        self._T_map_odom = np.eye(4)

    def add_odometry(self, odometry: Odometry) -> bool:
        """Take the newest pose; True if it became a keyframe. ValueError if time does not advance."""
        return self.sessions[-1].add(odometry, self.params)

    def add_closure(self, closure: LoopClosure, T_body_camera: Array | None = None) -> bool:
        """Tie the two keyframes nearest to the closure's moments; False if odometry does not cover both (yet).

        Moments nearest to one and the same keyframe tie nothing, which is True too. ``T_body_camera`` is where the
        camera of the closure sits on the body of the odometry; the same place if None.

        In a gap of the odometry it never will (`in_gap`): where the camera was by then nobody knows. ValueError for a
        closure whose moments are of two runs of one clock that it does not name. `ImplausibleError` for one that leads
        farther than odometry went, or knows nothing. No closure is believed to know better than the parameters' least
        sigmas.
        """
        one, other = self._of(closure.from_session, closure.from_ns), self._of(closure.to_session, closure.to_ns)
        if closure.from_ns >= closure.to_ns and (one is None or one == other):
            raise ValueError(
                f"expected a constraint whose *from* is before its *to* at {closure.to_ns} ns, got "
                f"{closure.from_ns} ns: it ties two runs of the clock; give each run a store of its own"
            )
        if one is None or other is None:
            return False
        ends = End(one, self._nearest(one, closure.from_ns)), End(other, self._nearest(other, closure.to_ns))
        if ends[0] != ends[1]:
            self._tie(closure, ends, np.eye(4) if T_body_camera is None else T_body_camera)
        self._name(one, closure.from_session)
        self._name(other, closure.to_session)
        return True

    def restore(self, tie: Tie) -> None:
        """Take a tie of a closure that was in another graph of these sessions. ValueError for keyframes it has not."""
        for end in tie[:2]:
            if not (
                0 <= end.session < len(self.sessions) and 0 <= end.keyframe < len(self.sessions[end.session].keyframes)
            ):
                raise ValueError(f"tie: expected a keyframe of the graph, got {end}")
        T, C = tie.constraint
        if tie.end1 == tie.end2 or T.shape != (4, 4) or C.shape != (6, 6) or not np.isfinite(C).all():
            raise ValueError(f"tie: expected a constraint of two keyframes, got shapes {T.shape} and {C.shape}")
        if not (is_rigid(T) and np.allclose(C, C.T) and np.linalg.eigvalsh(C).min() > 0.0):
            raise ValueError("tie: expected a rigid pose with a positive definite covariance, got another")
        self._closures.append(tie)

    def learn_sessions(self, closure: LoopClosure) -> None:
        """Take the names of sessions from a closure that is known without them."""
        for name, stamp_ns in ((closure.from_session, closure.from_ns), (closure.to_session, closure.to_ns)):
            with suppress(ValueError):
                session = self._of(name, stamp_ns)
                if session is not None:
                    self._name(session, name)

    def _name(self, session: int, name: int | None) -> None:
        if name is not None:
            self.sessions[session].names.add(name)

    def withdraw(self, is_withdrawn: Callable[[LoopClosure], bool]) -> int:
        """Take closures out of the graph, for good; how many."""
        found = {k for k, tie in enumerate(self._closures) if tie.closure is not None and is_withdrawn(tie.closure)}
        new = found - self._withdrawn
        self._withdrawn |= new
        return len(new)

    def _of(self, name: int | None, stamp_ns: int) -> int | None:
        """The session that has a moment: the one that does, and of two runs of a clock the one of this name.

        None where none has it yet. ValueError where two may, and nothing says which is meant.
        """
        covering = [k for k, one in enumerate(self.sessions) if one.covers(stamp_ns)]
        named = [k for k in covering if name in self.sessions[k].names]
        if len(named) == 1 or (len(covering) == 1 and not self._may_come(stamp_ns)):
            return (named or covering)[0]
        if name is not None and covering and self._may_come(stamp_ns):
            return None  # of the run that goes on, once it is there
        nameless = [k for k in covering if not self.sessions[k].names]
        if name is not None and len(nameless) == 1:
            return nameless[0]
        if covering:
            raise ValueError(
                f"expected a constraint that names its sessions, as {max(len(covering), 2)} runs of odometry have the "
                f"moment {stamp_ns} ns, got none that tells; objreg_msgs/LoopClosure names them"
            )
        return None

    def _may_come(self, stamp_ns: int) -> bool:
        """Whether odometry that goes on has yet to come to a moment after it began."""
        known = self.odometry.stamps_ns
        return not known or (known[0] <= stamp_ns and known[-1] < stamp_ns)

    def _nearest(self, session: int, stamp_ns: int) -> int:
        return self.sessions[session].keyframes.nearest(stamp_ns)

    def _tie(self, closure: LoopClosure, ends: tuple[End, End], T_body_camera: Array) -> None:
        one, other = (self.sessions[end.session] for end in ends)
        moments = one.keyframes.stamps_ns[ends[0].keyframe], other.keyframes.stamps_ns[ends[1].keyframe]
        ways = one.odometry, other.odometry
        with np.errstate(over="ignore", invalid="ignore"):  # what is no number then is refused
            constraint = between_keyframes(closure, ways, moments, T_body_camera, self.params.odometry_sigmas)
        self._refuse_implausible(ends, constraint)
        covariance = floored(constraint.covariance, self.params.least_sigmas)
        self._closures.append(Tie(*ends, constraint._replace(covariance=covariance), closure))

    def _refuse_implausible(self, ends: tuple[End, End], constraint: Constraint) -> None:
        known = np.abs(constraint.covariance).max()
        if not known <= VAGUEST:
            raise ImplausibleError(f"expected variances of at most {VAGUEST:g} m^2 and rad^2, got {known:g}")
        (most, way), metres = self._farthest(ends), np.linalg.norm(constraint.T_from_to[:3, 3])
        if not metres <= most:
            raise ImplausibleError(
                f"expected a constraint over at most {most:.2f} m, as odometry went {way:.2f} m meanwhile, "
                f"got {metres:.4g} m"
            )

    def _farthest(self, ends: tuple[End, End]) -> tuple[float, float]:
        """How far the second end may be from the first, and how far odometry went between them, m."""
        (s1, k1), (s2, k2) = ends
        if s1 != s2:
            return VAGUEST, np.inf
        session = self.sessions[s1]
        way = session.way_m(k1, k2)
        return SLACK_M + self.params.max_stretch * way + self.params.max_speed * session.silent_s(k1, k2), way

    def in_gap(self, closure: LoopClosure) -> bool:
        """Whether a moment of the closure lies in a gap of the newest odometry."""
        return self.odometry.in_gap(closure.from_ns) or self.odometry.in_gap(closure.to_ns)

    def is_before_odometry(self, closure: LoopClosure) -> bool:
        """Whether odometry began after a moment of the closure that no other session has: it will never be covered."""
        known = self.odometry.stamps_ns
        stamps = closure.from_ns, closure.to_ns
        return bool(known) and any(s < known[0] and not any(one.covers(s) for one in self.sessions) for s in stamps)

    # Solving

    def optimise(self) -> Summary:
        """Solve and adopt in one go."""
        problem = self.problem()
        return self.adopt(problem, problem.solve())

    def problem(self) -> Problem:
        """What there is to solve now; solved by one thread, while another goes on with the graph."""
        counts = tuple(len(session.keyframes) for session in self.sessions)
        return Problem(
            self._solver,
            tuple(self.sessions),
            counts,
            self._closures,
            len(self._closures),
            frozenset(self._withdrawn),
            self.params,
            self._inconsistent(),
        )

    def _inconsistent(self) -> frozenset[int]:
        if not self.params.pairwise_consistency:
            return frozenset()
        return self._pairwise.inconsistent(self._closures, self.sessions) - self._withdrawn

    def adopt(self, problem: Problem, solution: Solution) -> Summary:
        """Take over the solution of a problem of this graph; keyframes that came since then follow its last one."""
        self._solution = solution
        self._T_map_odom = self._correction()
        kept, pruned = list[tuple[LoopClosure, float]](), list[tuple[LoopClosure, float]]()
        for k, (is_kept, residual) in enumerate(zip(solution.kept, solution.residuals, strict=True)):
            closure = self._closures[k].closure
            if closure is not None and k not in problem.withdrawn and not np.isnan(residual):
                (kept if is_kept else pruned).append((closure, float(residual)))
        return Summary(tuple(row[0] for row in kept), tuple(row[0] for row in pruned), tuple(row[1] for row in pruned))

    # What comes of it

    @property
    def odometry(self) -> SparseTrajectory:
        """``T_odom_body`` of the newest session."""
        return self.sessions[-1].odometry

    @property
    def keyframes(self) -> Trajectory:
        """Those of the newest session, as odometry told them."""
        return self.sessions[-1].keyframes

    @property
    def ties(self) -> list[Tie]:
        """What odometry says from keyframe to keyframe, and the closures that are not withdrawn."""
        steps = [
            Tie(End(s, k - 1), End(s, k), session.step(k))
            for s, session in enumerate(self.sessions)
            for k in range(1, len(session.keyframes))
        ]
        return steps + self.closure_ties

    @property
    def closure_ties(self) -> list[Tie]:
        """The closures that are not withdrawn."""
        return [tie for k, tie in enumerate(self._closures) if k not in self._withdrawn]

    @property
    def is_placed(self) -> bool:
        """Whether it is known where the newest session is in the map: it is the first, or closures tie it there."""
        return len(self.sessions) == 1 or self._course() is not None

    @property
    def T_map_odom(self) -> Array:
        """The correction of the newest solved keyframe of the newest session; the identity before there is one."""
        return self._T_map_odom

    def _correction(self) -> Array:
        course = self._course()
        if course is None:
            return np.eye(4)
        last = len(course) - 1
        return course.of(np.array([last]))[0] @ inverse(self.keyframes.poses[last])

    def edges(self) -> tuple[Array, Array, Array]:
        """(m, 2, 3): where the ends of the kept closures are in the map, (n, 2, 3) those of the pruned ones, and (n,).

        The last are the residuals of the pruned ones, in standard deviations.
        """
        mapped = [stacked([T for _, T in way]) for way in self.paths()]
        residuals, kept = self._solution.residuals, self._solution.kept
        known = [
            k
            for k in np.flatnonzero(~np.isnan(residuals)).tolist()
            if k not in self._withdrawn and all(len(mapped[end.session]) for end in self._closures[k][:2])
        ]
        ends = [[mapped[end.session][end.keyframe][:3, 3] for end in self._closures[k][:2]] for k in known]
        places = np.array(ends).reshape(-1, 2, 3)
        return places[kept[known]], places[~kept[known]], residuals[known][~kept[known]]

    def path(self) -> list[tuple[int, Array]]:
        """Stamp and ``T_map_body`` of every keyframe of the newest session."""
        return list(zip(list(self.keyframes.stamps_ns), self._mapped_of(len(self.sessions) - 1), strict=True))

    def paths(self) -> list[list[tuple[int, Array]]]:
        """Those of every session; none for one that is not placed."""
        placed = [s == 0 or self._course(s) is not None for s in range(len(self.sessions))]
        stamps = [list(session.keyframes.stamps_ns) for session in self.sessions]
        return [
            list(zip(stamps[s], self._mapped_of(s), strict=True)) if is_placed else []
            for s, is_placed in enumerate(placed)
        ]

    def flat(self, left_out: Sequence[LoopClosure] = ()) -> tuple[list[Array], list[tuple[int, int, Constraint]]]:
        """``T_map_body`` of the keyframes of all sessions that are placed, in one row, and the ties between them."""
        paths, gone = self.paths(), {id(closure) for closure in left_out}
        first = np.cumsum([0, *(len(path) for path in paths)])
        edges = [
            (int(first[one.session] + one.keyframe), int(first[other.session] + other.keyframe), constraint)
            for one, other, constraint, closure in self.ties
            if paths[one.session] and paths[other.session] and id(closure) not in gone
        ]
        return [T for path in paths for _, T in path], edges

    def corrected(self, stamps_ns: Iterable[int]) -> list[Array]:
        """``T_map_body`` at any moments that the newest odometry covers; ValueError for one that it does not."""
        mapped = self._mapped_of(len(self.sessions) - 1)
        return [self._corrected_at(stamp, self.odometry.at(stamp), mapped) for stamp in stamps_ns]

    def _course(self, session: int = -1) -> Course | None:
        """The course of a session as far as it is solved."""
        session %= len(self.sessions)
        return self._solution.courses[session] if session < len(self._solution.courses) else None

    def _mapped_of(self, session: int) -> Array:
        """``T_map_body (n, 4, 4)`` of all keyframes of a session; those that are not solved yet follow the last."""
        course, odom = self._course(session), stacked(self.sessions[session].keyframes.poses)
        if course is None:
            return odom
        solved = course.of()
        T_map_odom = solved[-1] @ inverse(odom[len(solved) - 1])
        return np.concatenate([solved, T_map_odom @ odom[len(solved) :]])

    def _corrected_at(self, stamp_ns: int, T_odom_body: Array, mapped: Array) -> Array:
        """``T_map_body``: between keyframes it goes over smoothly from the correction of the one to the other's.

        What goes over is where they put the body. The corrections themselves turn about the origin of odometry, and
        between two of them a body far from there would leave its way.
        """
        bodies, near = Trajectory(), self.keyframes.nearest(stamp_ns)
        for k in range(max(near - 1, 0), min(near + 2, len(self.keyframes))):
            T_map_odom = mapped[k] @ inverse(self.keyframes.poses[k])
            bodies.append(self.keyframes.stamps_ns[k], T_map_odom @ T_odom_body)
        return bodies.at(min(max(stamp_ns, bodies.stamps_ns[0]), bodies.stamps_ns[-1]))
