# SPDX-License-Identifier: Apache-2.0
"""The map that a user sees: keyframes out of odometry, tied together by constraints."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from objreg_ros.data import Array, LoopClosure, Odometry
from objreg_ros.geometry import inverse, rotation_angle
from objreg_ros.mapper.constraint import (
    Constraint,
    between_keyframes,
    floored,
    open3d_information,
    unseen,
    wandering,
)
from objreg_ros.mapper.drift import Drift
from objreg_ros.mapper.optimisation import Edge, Solution, misfit, optimise, optimise_gradually, squared_residual
from objreg_ros.mapper.params import MapperParams
from objreg_ros.mapper.sparse import SparseTrajectory
from objreg_ros.mapper.steady import Steady, estimate, step
from objreg_ros.mapper.trajectory import Trajectory

FREEDOMS = 6  # of a closure
ROUNDS = 6  # most times that odometry is corrected
SLACK_M = 1.0  # that a constraint may lead farther than any way: odometry at rest trembles, and is not the camera
VAGUEST = 1e12  # m^2 and rad^2: ROS says "unknown" by less; what is known no better tells nothing
BETTER = 1.0  # squared standard deviations by which another solution has to fit better
DOUBT = 4.0  # what odometry may have drifted counts so much less from stage to stage
SOLVER_ERRORS = (ValueError, ArithmeticError, RuntimeError)  # numpy's and the optimisers' own
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
        """The best poses; closures with which there are none are left out and named: `Solution.unsolvable`."""
        solution = self._tried()
        if solution is not None:
            return solution
        sound = self._sound(frozenset(), [k for k, tie in enumerate(self.ties) if tie.closure is not None])
        taken = [k for k, tie in enumerate(self.ties) if tie.closure is None or k in sound]
        solution = self._with(sound)._tried() or Solution(self.poses, (True,) * len(taken))
        kept = dict(zip(taken, solution.kept, strict=True))
        left_out = tuple(k for k in range(len(self.ties)) if k not in kept)
        return Solution(solution.poses, tuple(kept.get(k, False) for k in range(len(self.ties))), left_out)

    def _sound(self, sound: frozenset[int], suspects: Sequence[int]) -> frozenset[int]:
        """``sound``, the numbers of closures that can be solved with, and with them all suspects that can be."""
        more = sound.union(suspects)
        if not suspects or self._with(more)._tried() is not None:
            return more
        if len(suspects) == 1:
            return sound
        half = len(suspects) // 2
        return self._sound(self._sound(sound, suspects[:half]), suspects[half:])

    def _with(self, closures: frozenset[int]) -> Problem:
        """The same with these closures alone."""
        ties = tuple(tie for k, tie in enumerate(self.ties) if tie.closure is None or k in closures)
        return self._replace(ties=ties)

    def _tried(self) -> Solution | None:
        """The solution; None where the optimiser raises or its poses are no numbers."""
        try:
            with np.errstate(all="ignore"):
                solution = self._best()
        except SOLVER_ERRORS:
            return None
        return solution if np.isfinite(solution.poses).all() else None

    def _best(self) -> Solution:
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
        limit = self.params.max_residual
        found = optimise(start, edges, limit)
        if all(found.kept):
            return found
        other = optimise_gradually(start, self._stages(steady), limit)
        gain = misfit(found.poses, edges, limit) - misfit(other.poses, edges, limit)
        return other if gain > BETTER else found

    def _stages(self, steady: Steady) -> list[list[Edge]]:
        """The edges, at first with closures known no better than odometry may have drifted, at last as they are."""
        ties = [self._corrected(tie, steady) for tie in self.ties]
        steps = [tie.constraint.covariance for tie in ties if tie.closure is None]
        drift = Drift(self.poses, steps, self.params.steady)
        drifts = [np.zeros((6, 6)) if tie.closure is None else drift.between(tie.k1, tie.k2) for tie in ties]
        ratios = [np.diag(D) / np.diag(tie.constraint.covariance) for tie, D in zip(ties, drifts, strict=True)]
        count = int(np.ceil(np.log(max(np.max(ratios), 1.0)) / np.log(DOUBT)))
        shares = [*(DOUBT**-k for k in range(count + 1)), 0.0]
        return [[_edge(tie, share * D) for tie, D in zip(ties, drifts, strict=True)] for share in shares]

    def _corrected(self, tie: Tie, steady: Steady) -> Tie:
        if tie.closure is not None:
            return tie
        T_k1_k2 = step(self.poses[tie.k1], self.poses[tie.k2], steady)
        return tie._replace(constraint=tie.constraint._replace(T_from_to=T_k1_k2))


@dataclass(frozen=True, slots=True)
class Summary:
    """What an optimisation came to: the closures that it kept, those that it pruned, and those that made it fail."""

    kept: tuple[LoopClosure, ...]
    pruned: tuple[LoopClosure, ...]
    unsolvable: tuple[LoopClosure, ...] = ()


class ImplausibleError(ValueError):
    """A closure claims what cannot be: a way that no body went, or a pose of which nothing is known."""


class PoseGraph:
    """Keyframes, the odometry between them and the closures; `optimise` makes them agree.

    ``odometry`` gives back what was added to within 1 mm and 0.05°, and the poses of keyframes exactly.
    """

    def __init__(self, params: MapperParams | None = None) -> None:
        self.params = params or MapperParams()
        self.odometry = SparseTrajectory()
        self.keyframes = Trajectory()  # T_odom_body
        self.ties: list[Tie] = []
        self._way: list[float] = []  # m that odometry went until each keyframe
        self._solved: tuple[Array, ...] = ()  # T_map_body of the first keyframes; the others follow the last of them

    def add_odometry(self, odometry: Odometry) -> bool:
        """Take the newest pose; True if it became a keyframe. ValueError if time does not advance."""
        self.odometry.append(odometry.stamp_ns, odometry.T_odom_body)
        if not self._moved_on(odometry.T_odom_body):
            return False
        self.odometry.pin()
        self.keyframes.append(odometry.stamp_ns, odometry.T_odom_body)
        self._way.append(self._way_to_newest())
        if len(self.keyframes) > 1:
            self.ties.append(self._step())
        return True

    def add_closure(self, closure: LoopClosure, T_body_camera: Array | None = None) -> bool:
        """Tie the two keyframes nearest to the closure's moments; False if odometry does not cover both (yet).

        Moments nearest to one and the same keyframe tie nothing, which is True too. ``T_body_camera`` is where the
        camera of the closure sits on the body of the odometry; the same place if None.

        In a gap of the odometry it never will (`in_gap`): where the camera was by then nobody knows. ValueError for a
        closure whose *from* is not before its *to*: the registrar looks back, so its moments are of two runs of the
        clock, and this odometry knows at most one of them. `ImplausibleError` for one that leads farther than odometry
        went, or knows nothing. No closure is believed to know better than the parameters' least sigmas.
        """
        if closure.from_ns >= closure.to_ns:
            raise ValueError(
                f"expected a constraint whose *from* is before its *to* at {closure.to_ns} ns, got "
                f"{closure.from_ns} ns: it ties two runs of the clock; give each run a store of its own"
            )
        if not (self.odometry.covers(closure.from_ns) and self.odometry.covers(closure.to_ns)):
            return False
        k1, k2 = (self.keyframes.nearest(stamp) for stamp in (closure.from_ns, closure.to_ns))
        T_body_camera = np.eye(4) if T_body_camera is None else T_body_camera
        if k1 != k2:
            k1_ns, k2_ns = self.keyframes.stamps_ns[k1], self.keyframes.stamps_ns[k2]
            moments, sigmas = (k1_ns, k2_ns), self.params.odometry_sigmas
            with np.errstate(over="ignore", invalid="ignore"):  # what is no number then is refused
                constraint = between_keyframes(closure, self.odometry, *moments, T_body_camera, sigmas)
            self._refuse_implausible(k1, k2, constraint)
            covariance = floored(constraint.covariance, self.params.least_sigmas)
            self.ties.append(Tie(k1, k2, constraint._replace(covariance=covariance), closure))
        return True

    def _refuse_implausible(self, k1: int, k2: int, constraint: Constraint) -> None:
        known = np.abs(constraint.covariance).max()
        if not known <= VAGUEST:
            raise ImplausibleError(f"expected variances of at most {VAGUEST:g} m^2 and rad^2, got {known:g}")
        silent_s = self.odometry.silent_s(*sorted((self.keyframes.stamps_ns[k1], self.keyframes.stamps_ns[k2])))
        way = abs(self._way[k2] - self._way[k1])
        most = SLACK_M + self.params.max_stretch * way + self.params.max_speed * silent_s
        metres = np.linalg.norm(constraint.T_from_to[:3, 3])
        if not metres <= most:
            raise ImplausibleError(
                f"expected a constraint over at most {most:.2f} m, as odometry went {way:.2f} m meanwhile, "
                f"got {metres:.4g} m"
            )

    def _way_to_newest(self) -> float:
        """How far odometry has gone until the newest keyframe, m."""
        if not self._way:
            return 0.0
        before, newest = self.keyframes.poses[-2:]
        return self._way[-1] + float(np.linalg.norm(newest[:3, 3] - before[:3, 3]))

    def in_gap(self, closure: LoopClosure) -> bool:
        """Whether a moment of the closure lies in a gap of the odometry."""
        return self.odometry.in_gap(closure.from_ns) or self.odometry.in_gap(closure.to_ns)

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
        left_out = set(solution.unsolvable)
        self.ties = [tie for k, tie in enumerate(self.ties) if k not in left_out]
        unsolvable = tuple(tie.closure for k, tie in enumerate(problem.ties) if k in left_out and tie.closure)
        together = enumerate(zip(problem.ties, solution.kept, strict=True))
        verdicts = [(tie.closure, kept) for k, (tie, kept) in together if k not in left_out]
        kept = tuple(closure for closure, keep in verdicts if closure is not None and keep)
        pruned = tuple(closure for closure, keep in verdicts if closure is not None and not keep)
        return Summary(kept, pruned, unsolvable)

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


def _edge(tie: Tie, doubt: Array | float = 0.0) -> Edge:
    """The edge of a tie, known less well by the covariance ``doubt``."""
    information = open3d_information(tie.constraint._replace(covariance=tie.constraint.covariance + doubt))
    return Edge(tie.k1, tie.k2, tie.constraint.T_from_to, information, uncertain=tie.closure is not None)
