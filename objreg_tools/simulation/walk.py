# SPDX-License-Identifier: Apache-2.0
"""Walks of a body with odometry that drifts and closures of which some are false: what a mapper gets, no images."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import Odometry
from objreg_ros.geometry import inverses, rotation_from_vector

PERIOD_NS = 500_000_000  # between two poses of odometry
NEAR_M = 1.5  # from here to there a place is met again,
APART = 20  # and at the earliest so many poses later
LEAST_SIGMA = 1e-6  # m and rad
FREE_TURN_M = 3.0  # a lie of this many metres may turn by anything


@dataclass(frozen=True)
class WalkParams:
    """How long a walk is, how its odometry drifts, and what its closures are like.

    A walk goes through corridors of ``corridor_m``, ``corridors`` by ``corridors`` of them, a pose every ``step_m``.
    """

    poses: int = 300
    step_m: float = 0.25
    corridor_m: float = 5.0
    corridors: int = 3
    drift_m: float = 0.02  # after one metre or one radian, growing with the root of the path length
    drift_deg: float = 1.0
    heading_deg_per_m: float = 0.0  # the steady error
    stretch: float = 0.0
    closures: int = 40
    sigma_m: float = 0.02
    sigma_deg: float = 0.5
    false_share: float = 0.0
    agreeing_share: float = 0.0  # of all closures: false ones that agree with each other
    lie_m: tuple[float, float] = (0.1, 1e9)
    claimed: tuple[float, float] = (1e-6, 2e-2)  # sigmas of the false ones, m and rad


@dataclass(frozen=True)
class Walk:
    """``T_world_body (n, 4, 4)``, odometry at the same times, and closures in order, each with ``is_false (m,)``."""

    T_world_body: Array
    odometry: tuple[Odometry, ...]
    closures: tuple[LoopClosure, ...]
    is_false: Array

    @property
    def right_closures(self) -> tuple[LoopClosure, ...]:
        """Those that are not false."""
        return tuple(closure for closure, is_false in zip(self.closures, self.is_false, strict=True) if not is_false)


def walk(params: WalkParams, seed: int) -> Walk:
    """The walk of a seed; the same closures are right whatever the share of false ones."""
    T = through_corridors(params, np.random.default_rng([seed, 0]))
    odometry = drifted(T, params, np.random.default_rng([seed, 1]))
    right = _right(T, params, np.random.default_rng([seed, 2]))
    lies = _false(T, len(right), params, np.random.default_rng([seed, 3]))
    rows = sorted(
        [(closure.to_ns, False, closure) for closure in right] + [(closure.to_ns, True, closure) for closure in lies],
        key=_when,
    )
    messages = tuple(Odometry(T_odom_body=pose, stamp_ns=k * PERIOD_NS) for k, pose in enumerate(odometry))
    return Walk(T, messages, tuple(row[2] for row in rows), np.array([row[1] for row in rows], bool))


def _when(row: tuple[int, bool, LoopClosure]) -> tuple[int, bool]:
    return row[:2]


def through_corridors(params: WalkParams, rng: np.random.Generator) -> Array:
    """True poses (n, 4, 4) along corridors, never straight back; the body looks ahead and turns over three steps."""
    per = max(round(params.corridor_m / params.step_m), 1)
    place, ahead, xy = np.zeros(2, int), np.array([1, 0]), [np.zeros(2)]
    while len(xy) < params.poses:
        ways = [np.array(way) for way in ((1, 0), (-1, 0), (0, 1), (0, -1))]
        inside = [way for way in ways if np.all((place + way >= 0) & (place + way <= params.corridors))]
        ahead = rng.choice([way for way in inside if np.any(way != -ahead)])
        xy += [params.corridor_m * (place + ahead * k / per) for k in range(1, per + 1)]
        place = place + ahead
    line = np.array(xy[: params.poses])
    steps = np.diff(line, axis=0, append=2 * line[-1:] - line[-2:-1])
    yaws = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    smooth = np.convolve(np.pad(yaws, 1, mode="edge"), np.full(3, 1 / 3), mode="valid")
    T = np.tile(np.eye(4), (params.poses, 1, 1))
    T[:, :2, 3], T[:, :3, :3] = line, Rotation.from_euler("z", smooth[:, None]).as_matrix()
    return T


def drifted(T_world_body: Array, params: WalkParams, rng: np.random.Generator) -> Array:
    """``T_odom_body (n, 4, 4)`` as odometry reports the poses, from where they begin."""
    steps = inverses(T_world_body[:-1]) @ T_world_body[1:]
    lengths = np.linalg.norm(steps[:, :3, 3], axis=1)
    way = lengths + Rotation.from_matrix(steps[:, :3, :3]).magnitude()
    wandering = np.sqrt(way / 3)[:, None] * [params.drift_m, np.radians(params.drift_deg)]
    steps[:, :3, 3] *= 1.0 + params.stretch
    steps = steps @ _errors(rng, wandering[:, 0], wandering[:, 1])
    turned = np.radians(params.heading_deg_per_m) * lengths
    steps[:, :3, :3] = steps[:, :3, :3] @ Rotation.from_euler("z", turned[:, None]).as_matrix()
    poses = [T_world_body[0]]
    for step in steps:
        poses.append(poses[-1] @ step)
    return np.array(poses)


def _right(T: Array, params: WalkParams, rng: np.random.Generator) -> list[LoopClosure]:
    """Closures where a place is met again, as well as they claim."""
    tree, found = cKDTree(T[:, :3, 3]), list[tuple[int, int]]()
    for b in rng.permutation(np.arange(len(T)).repeat(2)):
        near = [a for a in tree.query_ball_point(T[b, :3, 3], NEAR_M) if a <= b - APART]
        if near:
            found.append((int(rng.choice(near)), int(b)))
        if len(found) == params.closures:
            break
    sigmas = params.sigma_m, float(np.radians(params.sigma_deg))
    errors = _errors(rng, np.full(len(found), sigmas[0]), np.full(len(found), sigmas[1]))
    return [_closure(T, a, b, error, sigmas) for (a, b), error in zip(found, errors, strict=True)]


def _false(T: Array, right: int, params: WalkParams, rng: np.random.Generator) -> list[LoopClosure]:
    """So many that they have their shares of all."""
    alone, agreeing = params.false_share, params.agreeing_share
    scale = right / max(1.0 - alone - agreeing, 1e-9)
    closures = [_lie(T, *_moments(len(T), rng), _wrong(params, rng), params, rng) for _ in range(round(alone * scale))]
    count = round(agreeing * scale)
    if count:
        a, b = _moments(len(T), rng)
        T_world_wrong = T[a] @ _wrong(params, rng) @ inverses(T[a : a + 1])[0]  # the same for all: a twin of a place
        for _ in range(count):
            i, j = _beside(a, len(T), rng), _beside(b, len(T), rng)
            error = inverses(T[j : j + 1])[0] @ T_world_wrong @ T[j]
            closures.append(_lie(T, min(i, j), max(i, j) + (i == j), error, params, rng))
    return closures


def _moments(poses: int, rng: np.random.Generator) -> tuple[int, int]:
    a = int(rng.integers(0, poses - APART))
    return a, int(rng.integers(a + APART, poses))


def _beside(k: int, poses: int, rng: np.random.Generator) -> int:
    return int(np.clip(k + rng.integers(-4, 5), 0, poses - 2))


def _wrong(params: WalkParams, rng: np.random.Generator) -> Array:
    """An error (4, 4) of a size from the whole range, any order of magnitude alike, in the plane of the walk."""
    metres, heading = np.exp(rng.uniform(*np.log(params.lie_m))), rng.uniform(-np.pi, np.pi)
    turn = rng.uniform(-np.pi, np.pi) * min(metres / FREE_TURN_M, 1.0)
    E = np.eye(4)
    E[:2, 3], E[:3, :3] = (
        metres * np.array([np.cos(heading), np.sin(heading)]),
        Rotation.from_euler("z", turn).as_matrix(),
    )
    return E


def _lie(T: Array, a: int, b: int, error: Array, params: WalkParams, rng: np.random.Generator) -> LoopClosure:
    sigma = float(np.exp(rng.uniform(*np.log(params.claimed))))
    return _closure(T, a, b, error, (sigma, sigma))


def _closure(T: Array, a: int, b: int, error: Array, sigmas: tuple[float, float]) -> LoopClosure:
    T_from_to = inverses(T[a : a + 1])[0] @ T[b] @ error
    covariance = np.diag(np.square(np.repeat(np.maximum(sigmas, LEAST_SIGMA), 3)))
    return LoopClosure(
        from_ns=a * PERIOD_NS, to_ns=b * PERIOD_NS, T_from_to=T_from_to, covariance=covariance, labels=("cup",)
    )


def _errors(rng: np.random.Generator, metres: Array, radians: Array) -> Array:
    """Errors (n, 4, 4) with these sigmas in every axis."""
    E = np.tile(np.eye(4), (len(metres), 1, 1))
    E[:, :3, 3] = metres[:, None] * rng.normal(size=(len(metres), 3))
    E[:, :3, :3] = rotation_from_vector(radians[:, None] * rng.normal(size=(len(metres), 3)))
    return E
