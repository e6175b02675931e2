# SPDX-License-Identifier: Apache-2.0
"""The map that a user sees: keyframes out of odometry of one robot or several, tied together by closures."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from objreg_mapper.closure_constraint import Mounting, constraint_of
from objreg_mapper.constraint import Constraint
from objreg_mapper.optimisation.doubts import Doubts
from objreg_mapper.optimisation.problem import End, Problem, Solution, SolvedTrajectory, Tie
from objreg_mapper.optimisation.solver import Solver
from objreg_mapper.optimisation.strain import Strain, strain_of
from objreg_mapper.params import MapperParams
from objreg_mapper.session import Session, stacked
from objreg_mapper.sessions import Sessions, moments_of
from objreg_mapper.sparse import SparseTrajectory
from objreg_mapper.trajectory import Trajectory
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure, may_be_same
from objreg_ros.data.frames import Odometry
from objreg_ros.geometry import inverse, is_rigid


@dataclass(frozen=True, slots=True)
class MapSummary:
    """What an optimisation came to: the closures that it kept, and those that it pruned, and with what ``residuals``.

    These are of the pruned ones, in standard deviations. ``strain`` is how far those that are kept are from odometry.
    """

    kept: tuple[LoopClosure, ...] = ()
    pruned: tuple[LoopClosure, ...] = ()
    residuals: tuple[float, ...] = ()
    strain: Strain = Strain()


class UnknownRobotError(ValueError):
    """A closure is of a robot of which there is no odometry."""


class PoseGraph:
    """Sessions of odometry and the closures between their keyframes; `optimise` makes them agree.

    The map's frame is that of the first session's odometry at its beginning, whose ever that is. Another session is in
    it once closures tie it there. What is asked of a robot is asked of its newest session, in which its odometry goes
    on; where there is one robot, it needs no name.
    """

    def __init__(self, params: MapperParams | None = None) -> None:
        self.params = params or MapperParams()
        self.sessions = Sessions()
        self.sessions.begin_session()
        self._closures: list[Tie] = []
        self._withdrawn: set[int] = set()
        self._solver, self._doubts = Solver(), Doubts()
        self._solution = Solution((), np.zeros(0, bool), np.zeros(0))
        self._T_map_odom: dict[int, Array] = {}  # by session, as far as they are solved

    # What comes in

    def begin_session(self, name: int | None = None, robot: str = "") -> None:
        """Odometry of a robot from now on is of another run; nothing ties it to the runs before."""
        self.sessions.begin_session(name, robot)

    def add_odometry(self, odometry: Odometry, robot: str = "") -> bool:
        """Take the newest pose; True if it became a keyframe. ValueError if time does not advance.

        The first session of a robot begins with its first pose.
        """
        if self.sessions.newest(robot) is None:
            self.begin_session(robot=robot)
        return self._going_on(robot).add_pose(odometry, self.params)

    def add_closure(self, closure: LoopClosure, T_body_camera: Array | Mounting | None = None) -> bool:
        """Tie the two keyframes nearest to the closure's stamps; False if odometry does not cover both (yet).

        Stamps nearest to one and the same keyframe tie nothing, which is True too. ``T_body_camera`` is where the
        camera of the closure sits on the body of the odometry; the same place if None. A callable gives it for the
        robot of a session and the name of a camera.

        In a gap of the odometry it never will (`in_gap`): the camera's pose is unknown there. ValueError for a
        closure whose stamps are of two runs of one clock that it does not name. `ImplausibleError` for one that leads
        farther than odometry went, or knows nothing. `UnknownRobotError` for one of two robots whose odometry is one.
        No closure is believed to know better than `LEAST_SIGMAS`.
        """
        one, other = map(self.sessions.of, moments_of(closure))
        of_two = not may_be_same((closure.from_robot,) * 2, (closure.to_robot,) * 2)
        if of_two and one is not None and one == other:
            robots = f"{closure.from_robot!r} and {closure.to_robot!r}"
            raise UnknownRobotError(f"expected a constraint of one robot, as odometry is, got one of {robots}")
        if closure.from_ns >= closure.to_ns and (one is None or one == other) and not of_two:
            raise ValueError(
                f"expected a constraint whose *from* is before its *to* at {closure.to_ns} ns, got "
                f"{closure.from_ns} ns: it ties two runs of the clock; give each run a store of its own"
            )
        if one is None or other is None:
            return False
        ends = End(one, self._nearest(one, closure.from_ns)), End(other, self._nearest(other, closure.to_ns))
        if ends[0] != ends[1]:
            constraint = constraint_of(closure, ends, self.sessions, T_body_camera, self.params)
            self._closures.append(Tie(*ends, constraint, closure))
        self.sessions.learn(one, closure.from_session)
        self.sessions.learn(other, closure.to_session)
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
        self.sessions.learn_from(closure)

    def withdraw(self, is_withdrawn: Callable[[LoopClosure], bool]) -> int:
        """Take closures out of the graph; how many. One that comes again is another tie."""
        found = {k for k, tie in enumerate(self._closures) if tie.closure is not None and is_withdrawn(tie.closure)}
        new = found - self._withdrawn
        self._withdrawn |= new
        return len(new)

    def _nearest(self, session: int, stamp_ns: int) -> int:
        return self.sessions[session].keyframes.nearest(stamp_ns)

    def in_gap(self, closure: LoopClosure) -> bool:
        """Whether a stamp of the closure lies in a gap of the newest odometry."""
        return any(map(self.sessions.in_gap, moments_of(closure)))

    def is_before_odometry(self, closure: LoopClosure) -> bool:
        """Whether odometry began after a stamp of the closure that no other session has: it will never be covered."""
        return any(map(self.sessions.is_before_odometry, moments_of(closure)))

    # Solving

    def optimise(self) -> MapSummary:
        """Solve and adopt in one go."""
        problem = self.problem()
        return self.adopt_solution(problem, problem.solve())

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
            self._doubts.of(self._closures, self.sessions, self.params) - self._withdrawn,
        )

    def adopt_solution(self, problem: Problem, solution: Solution) -> MapSummary:
        """Take over the solution of a problem of this graph; keyframes that came since then follow its last one."""
        self._solution = solution
        self._T_map_odom = {
            s: self._correction(s, trajectory) for s, trajectory in enumerate(solution.trajectories) if trajectory
        }
        kept, pruned = list[tuple[LoopClosure, float]](), list[tuple[LoopClosure, float]]()
        for k, (is_kept, residual) in enumerate(zip(solution.kept, solution.residuals, strict=True)):
            closure = self._closures[k].closure
            if closure is not None and k not in problem.withdrawn and not np.isnan(residual):
                (kept if is_kept else pruned).append((closure, float(residual)))
        return MapSummary(
            tuple(row[0] for row in kept),
            tuple(row[0] for row in pruned),
            tuple(row[1] for row in pruned),
            self._strain(problem, solution),
        )

    def _strain(self, problem: Problem, solution: Solution) -> Strain:
        """How far the closures that are kept are from odometry, with what is steadily wrong taken out of it."""
        chains = {s: trajectory.chain for s, trajectory in enumerate(solution.trajectories) if trajectory}
        kept = [self._closures[k] for k in np.flatnonzero(solution.kept).tolist()]
        return strain_of(kept, chains, problem.params.picture_sigmas)

    # What comes of it

    def _going_on(self, robot: str) -> Session:
        """The newest session of a robot; one of no odometry before it begins."""
        session = self.sessions.newest(robot)
        return Session(robot) if session is None else self.sessions[session]

    @property
    def odometry(self) -> SparseTrajectory:
        """``T_odom_body`` of the one robot's newest session."""
        return self._going_on("").odometry

    @property
    def keyframes(self) -> Trajectory:
        """Those of the one robot's newest session, as odometry gave them."""
        return self.keyframes_of("")

    def keyframes_of(self, robot: str) -> Trajectory:
        """Those of a robot's newest session, as odometry gave them; none before it begins."""
        return self._going_on(robot).keyframes

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
        """Whether it is known where the one robot is in the map: its session is the first, or closures tie it there."""
        return self.T_map_odom_of("") is not None

    @property
    def T_map_odom(self) -> Array:
        """The correction of the newest solved keyframe of the one robot; the identity before there is one."""
        T_map_odom = self.T_map_odom_of("")
        return np.eye(4) if T_map_odom is None else T_map_odom

    def T_map_odom_of(self, robot: str) -> Array | None:
        """The correction of a robot's newest solved keyframe; None where it is not known where the robot is in the map.

        The identity in the first session of all before it is solved.
        """
        session = self.sessions.newest(robot)
        return None if session is None else self._T_map_odom.get(session, np.eye(4) if session == 0 else None)

    def _correction(self, session: int, trajectory: SolvedTrajectory) -> Array:
        last = len(trajectory) - 1
        return trajectory.of(np.array([last]))[0] @ inverse(self.sessions[session].keyframes.poses[last])

    def edges(self) -> tuple[Array, Array, Array]:
        """(m, 2, 3): where the ends of the kept closures are in the map, (n, 2, 3) those of the pruned ones, and (n,).

        The last are the residuals of the pruned ones, in standard deviations.
        """
        mapped = [stacked([T for _, T in path]) for path in self.paths()]
        residuals, kept = self._solution.residuals, self._solution.kept
        known = [
            k
            for k in np.flatnonzero(~np.isnan(residuals)).tolist()
            if k not in self._withdrawn and all(len(mapped[end.session]) for end in self._closures[k][:2])
        ]
        ends = [[mapped[end.session][end.keyframe][:3, 3] for end in self._closures[k][:2]] for k in known]
        places = np.array(ends).reshape(-1, 2, 3)
        return places[kept[known]], places[~kept[known]], residuals[known][~kept[known]]

    def path(self, robot: str = "") -> list[tuple[int, Array]]:
        """Stamp and ``T_map_body`` of every keyframe of a robot's newest session; as odometry gives it, if unplaced."""
        session = self.sessions.newest(robot)
        return [] if session is None else self._path_of(session)

    def paths(self) -> list[list[tuple[int, Array]]]:
        """Those of every session; none for one that is not placed."""
        return [self._path_of(s) if self.is_in_map(s) else [] for s in range(len(self.sessions))]

    def is_in_map(self, session: int) -> bool:
        """Whether it is known where a session, by number, is in the map: it is the first, or closures tie it there."""
        return session == 0 or self._trajectory(session) is not None

    def _path_of(self, session: int) -> list[tuple[int, Array]]:
        return list(zip(list(self.sessions[session].keyframes.stamps_ns), self._mapped_of(session), strict=True))

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

    def flat_times(self) -> list[tuple[int, int]]:
        """The stamp in ns of each keyframe of `flat`, and the number of its session."""
        placed = [number for number in range(len(self.sessions)) if self.is_in_map(number)]
        return [(int(stamp), number) for number in placed for stamp in self.sessions[number].keyframes.stamps_ns]

    def corrected(self, stamps_ns: Iterable[int], robot: str = "", session: int | None = None) -> list[Array]:
        """``T_map_body`` at any stamps that a robot's newest odometry covers; ValueError for one that it does not.

        With ``session``, a number, of that one.
        """
        number = self.sessions.newest(robot) if session is None else session
        known = Session(robot) if number is None else self.sessions[number]
        mapped = np.zeros((0, 4, 4)) if number is None else self._mapped_of(number)
        return [_corrected_at(stamp, known, mapped) for stamp in stamps_ns]

    def _trajectory(self, session: int) -> SolvedTrajectory | None:
        """The course of a session as far as it is solved."""
        return self._solution.trajectories[session] if session < len(self._solution.trajectories) else None

    def _mapped_of(self, session: int) -> Array:
        """``T_map_body (n, 4, 4)`` of all keyframes of a session; those that are not solved yet follow the last."""
        trajectory, odom = self._trajectory(session), stacked(self.sessions[session].keyframes.poses)
        if trajectory is None:
            return odom
        solved = trajectory.of()
        T_map_odom = solved[-1] @ inverse(odom[len(solved) - 1])
        return np.concatenate([solved, T_map_odom @ odom[len(solved) :]])


def _corrected_at(stamp_ns: int, session: Session, mapped: Array) -> Array:
    """``T_map_body``: between keyframes it goes over smoothly from the correction of the one to the other's.

    What goes over is where they put the body. The corrections themselves turn about the origin of odometry, and
    between two of them a body far from there would leave its path.
    """
    T_odom_body, keyframes = session.odometry.at(stamp_ns), session.keyframes
    bodies, near = Trajectory(), keyframes.nearest(stamp_ns)
    for k in range(max(near - 1, 0), min(near + 2, len(keyframes))):
        bodies.append(keyframes.stamps_ns[k], mapped[k] @ inverse(keyframes.poses[k]) @ T_odom_body)
    return bodies.at(min(max(stamp_ns, bodies.stamps_ns[0]), bodies.stamps_ns[-1]))
