# SPDX-License-Identifier: Apache-2.0
"""The map that a user sees: keyframes out of odometry, tied together by constraints."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from objreg_ros.data import Array, LoopClosure, Odometry
from objreg_ros.geometry import inverse, leaps, rotation_angle
from objreg_ros.mapper.constraint import Constraint, between_keyframes, open3d_information, unseen, wandering
from objreg_ros.mapper.optimisation import Edge, Solution, optimise, squared_residual
from objreg_ros.mapper.params import MapperParams
from objreg_ros.mapper.sparse import SparseTrajectory
from objreg_ros.mapper.steady import Steady, estimate, step
from objreg_ros.mapper.trajectory import Trajectory

FREEDOMS = 6  # of a closure
ROUNDS = 6  # most times that odometry is corrected
SETTLED = 5e-4  # rad/m and m/m: a change of its steady error that matters no more


class Tie(NamedTuple):
    """A constraint between two keyframes by their numbers; ``closure`` is what it was made of, None for odometry."""

    k1: int
    k2: int
    constraint: Constraint
    closure: LoopClosure | None = None


class Problem(NamedTuple):
    """What there is to solve at one moment; `solve` may run on another thread than the graph."""

    poses: tuple[Array, ...]
    ties: tuple[Tie, ...]
    params: MapperParams

    def solve(self) -> Solution:
        """The poses that agree best with odometry and with the closures that can be believed.

        With what is steadily wrong with odometry only where that explains as much more as three more numbers must
        (Schwarz, "Estimating the dimension of a model", 1978): a few closures that are all a little wrong one way are
        no evidence of it.
        """
        closures = sum(tie.closure is not None for tie in self.ties)
        if closures == 0:
            return Solution(self.poses, (True,) * len(self.ties))
        plain = self._solved(self.poses, Steady())
        if not any(self.params.steady):
            return plain
        steady, solution = self._calibrated(plain)
        gain = self._misfit(plain, Steady()) - self._misfit(solution, steady)
        return solution if gain > len(steady) * np.log(FREEDOMS * closures) else plain

    def _calibrated(self, solution: Solution) -> tuple[Steady, Solution]:
        """In turn what the poses say is steadily wrong with odometry, and the poses, until the first changes little."""
        found = Steady()
        for _ in range(ROUNDS):
            known = found
            found = estimate(self.poses, solution.poses, self.params.odometry_sigmas, self.params.steady)
            solution = self._solved(solution.poses, found)
            if np.allclose(found, known, atol=SETTLED):
                break
        return found, solution

    def _misfit(self, solution: Solution, steady: Steady) -> float:
        """The squared residuals of odometry and closures in their standard deviations, and those of what is steady."""
        residuals = [squared_residual(solution.poses, _edge(self._corrected(tie, steady))) for tie in self.ties]
        unexpected = [part / sigma for part, sigma in zip(steady, self.params.steady, strict=True) if sigma > 0]
        return float(np.minimum(residuals, self.params.max_residual**2).sum() + np.square(unexpected).sum())

    def _solved(self, start: Sequence[Array], steady: Steady) -> Solution:
        """The solution from where it starts, with odometry corrected."""
        edges = [_edge(self._corrected(tie, steady)) for tie in self.ties]
        return optimise(start, edges, self.params.max_residual)

    def _corrected(self, tie: Tie, steady: Steady) -> Tie:
        if tie.closure is not None:
            return tie
        T_k1_k2 = step(self.poses[tie.k1], self.poses[tie.k2], steady)
        return tie._replace(constraint=tie.constraint._replace(T_from_to=T_k1_k2))


@dataclass(frozen=True, slots=True)
class Summary:
    """What an optimisation came to: the closures that it kept and those that it pruned."""

    kept: tuple[LoopClosure, ...]
    pruned: tuple[LoopClosure, ...]


class PoseGraph:
    """Keyframes, the odometry between them and the closures; `optimise` makes them agree.

    ``T_body_camera`` is where the camera of the closures sits on the body of the odometry. ``odometry`` gives back what
    was added to within 1 mm and 0.05°, and the poses of keyframes exactly.
    """

    def __init__(self, params: MapperParams | None = None, T_body_camera: Array | None = None) -> None:
        self.params = params or MapperParams()
        self.T_body_camera = np.eye(4) if T_body_camera is None else T_body_camera
        self.odometry = SparseTrajectory()
        self.keyframes = Trajectory()  # T_odom_body
        self.ties: list[Tie] = []
        self._solved: tuple[Array, ...] = ()  # T_map_body of the first keyframes; the others follow the last of them

    def add_odometry(self, odometry: Odometry) -> bool:
        """Take the newest pose; True if it became a keyframe. ValueError if time does not advance."""
        self.odometry.append(odometry.stamp_ns, odometry.T_odom_body)
        if not self._moved_on(odometry.T_odom_body):
            return False
        self.odometry.pin()
        self.keyframes.append(odometry.stamp_ns, odometry.T_odom_body)
        if len(self.keyframes) > 1:
            self.ties.append(self._step())
        return True

    def add_closure(self, closure: LoopClosure) -> bool:
        """Tie the two keyframes nearest to the closure's moments; False if odometry does not cover both (yet).

        Moments nearest to one and the same keyframe tie nothing, which is True too.

        In a gap of the odometry it never will (`in_gap`): where the camera was by then nobody knows. ValueError for a
        closure whose *from* is not before its *to*: the registrar looks back, so its moments are of two runs of the
        clock, and this odometry knows at most one of them.
        """
        if closure.from_ns >= closure.to_ns:
            raise ValueError(
                f"expected a constraint whose *from* is before its *to* at {closure.to_ns} ns, got "
                f"{closure.from_ns} ns: it ties two runs of the clock; give each run a store of its own"
            )
        if not (self.odometry.covers(closure.from_ns) and self.odometry.covers(closure.to_ns)):
            return False
        k1, k2 = (self.keyframes.nearest(stamp) for stamp in (closure.from_ns, closure.to_ns))
        if k1 != k2:
            k1_ns, k2_ns = self.keyframes.stamps_ns[k1], self.keyframes.stamps_ns[k2]
            moments, sigmas = (k1_ns, k2_ns), self.params.odometry_sigmas
            constraint = between_keyframes(closure, self.odometry, *moments, self.T_body_camera, sigmas)
            self.ties.append(Tie(k1, k2, constraint, closure))
        return True

    def in_gap(self, closure: LoopClosure) -> bool:
        """Whether a moment of the closure lies in a gap of the odometry."""
        return self.odometry.in_gap(closure.from_ns) or self.odometry.in_gap(closure.to_ns)

    def leaps(self, odometry: Odometry) -> bool:
        """Whether odometry has begun anew: no body moves so from the newest pose to this later one."""
        if not len(self.odometry):
            return False
        seconds = 1e-9 * (odometry.stamp_ns - self.odometry.stamps_ns[-1])
        return leaps(self.odometry.poses[-1], odometry.T_odom_body, seconds, self.params.max_speed, np.eye(4))

    def optimise(self) -> Summary:
        """Solve and adopt in one go."""
        problem = self.problem()
        return self.adopt(problem, problem.solve())

    def problem(self) -> Problem:
        """What there is to solve now."""
        return Problem(tuple(self.keyframes.poses), tuple(self.ties), self.params)

    def adopt(self, problem: Problem, solution: Solution) -> Summary:
        """Take over the solution of a problem of this graph; keyframes that came since then follow its last one."""
        self._solved = solution.poses
        verdicts = [(tie.closure, kept) for tie, kept in zip(problem.ties, solution.kept, strict=True)]
        kept = tuple(closure for closure, keep in verdicts if closure is not None and keep)
        pruned = tuple(closure for closure, keep in verdicts if closure is not None and not keep)
        return Summary(kept, pruned)

    @property
    def T_map_odom(self) -> Array:
        """The correction of the newest solved keyframe; the identity before there is one."""
        return self._correction(len(self._solved) - 1) if self._solved else np.eye(4)

    def path(self) -> list[tuple[int, Array]]:
        """Stamp and ``T_map_body`` of every keyframe."""
        return [(stamp, self._correction(k) @ T) for k, (stamp, T) in enumerate(self.keyframes)]

    def corrected(self, stamps_ns: Iterable[int]) -> list[Array]:
        """``T_map_body`` at any moments that odometry covers; ValueError for one that it does not."""
        return [self._corrected_at(stamp, self.odometry.at(stamp)) for stamp in stamps_ns]

    def _correction(self, k: int) -> Array:
        """``T_map_odom`` at a keyframe."""
        if not self._solved:
            return np.eye(4)
        k = min(k, len(self._solved) - 1)
        return self._solved[k] @ inverse(self.keyframes.poses[k])

    def _corrected_at(self, stamp_ns: int, T_odom_body: Array) -> Array:
        """``T_map_body``: between keyframes it goes over smoothly from the correction of the one to the other's.

        What goes over is where they put the body. The corrections themselves turn about the origin of odometry, and
        between two of them a body far from there would leave its way.
        """
        bodies = Trajectory()
        near = self.keyframes.nearest(stamp_ns)
        for k in range(max(near - 1, 0), min(near + 2, len(self.keyframes))):
            bodies.append(self.keyframes.stamps_ns[k], self._correction(k) @ T_odom_body)
        return bodies.at(min(max(stamp_ns, bodies.stamps_ns[0]), bodies.stamps_ns[-1]))

    def _moved_on(self, T_odom_body: Array) -> bool:
        if not self.keyframes.poses:
            return True
        T_last_body = inverse(self.keyframes.poses[-1]) @ T_odom_body
        turned = np.degrees(rotation_angle(T_last_body[:3, :3])) >= self.params.keyframe_rotation
        return bool(turned or np.linalg.norm(T_last_body[:3, 3]) >= self.params.keyframe_translation)

    def _step(self) -> Tie:
        """What odometry says between the two newest keyframes: next to nothing where it was silent meanwhile."""
        k1, k2 = len(self.keyframes) - 2, len(self.keyframes) - 1
        T_k1_k2 = inverse(self.keyframes.poses[k1]) @ self.keyframes.poses[k2]
        silent_s = self.odometry.silent_s(self.keyframes.stamps_ns[k1], self.keyframes.stamps_ns[k2])
        C = wandering(T_k1_k2, self.params.odometry_sigmas) + unseen(silent_s, self.params.max_speed)
        return Tie(k1, k2, Constraint(T_k1_k2, C))


def _edge(tie: Tie) -> Edge:
    information = open3d_information(tie.constraint)
    return Edge(tie.k1, tie.k2, tie.constraint.T_from_to, information, uncertain=tie.closure is not None)
