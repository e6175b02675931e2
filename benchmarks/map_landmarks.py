# SPDX-License-Identifier: Apache-2.0
"""Do objects help as landmarks in the pose graph? Their sightings as ranges and bearings beside the closures.

Closures are made of the same sightings, so nothing here is independent of them. No sighting gives a yaw: that of an
object is known from two views laid upon each other, which is what a closure says.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import gtsam
import numpy as np
from map_limits import ODOMETRY, OURS, SEED, Case, Variant, as_found, filled, kept
from map_peers import Dense, factors_of, values_of
from sources import detector_of, read_source, with_drift
from tqdm import tqdm

from objreg_mapper.pose_graph import PoseGraph
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import UNNAMED, Frame
from objreg_ros.geometry import inverse, transform
from objreg_ros.keyframes.frame_window import SessionNumbers
from objreg_ros.keyframes.fusion import fuse
from objreg_ros.keyframes.keyframer import Keyframer
from objreg_ros.memory.landmarks import MIDDLE_WANDERS, RADIUS_M, Landmarks, Link, Merge
from objreg_ros.memory.sighting import Sighting, sightings_of
from objreg_ros.registrar.params import RegistrarParams
from objreg_tools.report.run.trajectory_error import absolute_trajectory_error
from objreg_tools.truth import Truth

LEAST_SIGMA_M = 0.005  # of an object's middle
SHARES = np.array([0.5, 1.0]) * MIDDLE_WANDERS  # and of its extent, one sigma across the line of sight and along it
MEDIANS = np.array([1.1774, 0.6745])  # of errors across, which have two axes, and along, in standard deviations
HUBER, LIMIT = 1.345, 3.0  # standard deviations: from where a sighting counts less, and from where it is left out
BASE = "closures alone"


@dataclass(frozen=True)
class Shown:
    """A keyframe of the registrar: its objects, and their middles ``xyz (m, 3)`` in the camera."""

    stamp_ns: int
    xyz: Array
    sightings: tuple[Sighting, ...]


def seen(path: Path, folder: Path) -> list[Shown]:
    """Those of a recording with the odometry of `map_limits.found`; out of a file where they were seen before."""
    shown: list[Shown] = kept(path, folder, lambda: _seen(path), ".shown")
    return shown


def _seen(path: Path) -> list[Shown]:
    with read_source(path, detector_of(), SEED) as source:
        return shown_of(source.frames)


def shown_of(frames: Iterable[Frame]) -> list[Shown]:
    """The keyframes of frames, with their objects."""
    params = RegistrarParams()
    keyframer = Keyframer(params, SessionNumbers(1))
    windows = [keyframer.add_frame(frame) for frame in frames] + [keyframer.finish_window()]
    keyframes = [fuse(window, params) for window in windows if window is not None]
    return [
        Shown(keyframe.stamp_ns, np.array([item.centroid for item in keyframe.objects]), sightings_of(keyframe))
        for keyframe in keyframes
        if keyframe.objects
    ]


# Which sightings are of one object


Names = list[tuple[int, ...]]  # the landmark of each sighting of each keyframe
Where = Callable[[int], "Array | None"]  # the camera (4, 4) at a stamp


def named(shown: Sequence[Shown], where: Where | None, closures: Sequence[LoopClosure] = ()) -> Names:
    """By `Landmarks`, as the registrar does: from where objects are, if known, and what closures lay on what."""
    placed = [_placed(one, where, k) for k, one in enumerate(shown)]
    numbers = {one.stamp_ns: k for k, one in enumerate(shown)}
    pairs: list[list[tuple[int, int, int]]] = [[] for _ in shown]
    for closure in closures:
        if closure.from_ns in numbers and closure.to_ns in numbers:
            there, here = numbers[closure.from_ns], numbers[closure.to_ns]
            pairs[here] += [(i, there, j) for i, j in _laid_upon(shown[here], shown[there], closure.T_from_to)]
    return _in_turn(placed, pairs)


def _placed(one: Shown, where: Where | None, number: int) -> tuple[Sighting, ...]:
    """Its sightings; in a session for itself, which has nothing in common with others, where its place is not known."""
    T = None if where is None else where(one.stamp_ns)
    session, T = (number, np.eye(4)) if T is None else (-1, T)
    middles = transform(T, one.xyz)
    return tuple(
        replace(s, position=p, camera=T[:3, 3].copy(), session=session)
        for s, p in zip(one.sightings, middles, strict=True)
    )


def _laid_upon(here: Shown, there: Shown, T_there_here: Array) -> list[tuple[int, int]]:
    """The objects of one label, by number, that are each other's nearest, and near enough to be one."""
    if not len(here.xyz) or not len(there.xyz):
        return []
    apart = np.linalg.norm(transform(T_there_here, here.xyz)[:, None] - there.xyz[None], axis=2)
    alike = np.array([[a.label == b.label for b in there.sightings] for a in here.sightings])
    extents = np.array([[min(a.extent, b.extent) for b in there.sightings] for a in here.sightings])
    apart = np.where(alike & (apart < RADIUS_M + MIDDLE_WANDERS * extents), apart, np.inf)
    nearest = [(i, int(row.argmin())) for i, row in enumerate(apart) if np.isfinite(row).any()]
    return [(i, j) for i, j in nearest if apart[:, j].argmin() == i]


def _in_turn(placed: Sequence[tuple[Sighting, ...]], pairs: Sequence[Sequence[tuple[int, int, int]]]) -> Names:
    """The landmarks of keyframes in turn; ``pairs`` say which object is which of which keyframe before."""
    landmarks, known = Landmarks(RegistrarParams()), list[tuple[Sighting, ...]]()
    for sightings, matches in zip(placed, pairs, strict=True):
        links = [Link(index=i, of=known[there][j], R_there_here=np.eye(3)) for i, there, j in matches]
        assigned, merged = landmarks.assign(sightings, links)
        landmarks.add_sightings(assigned, merged)
        known = [_renamed(row, merged) for row in known] + [assigned]
    return [tuple(sighting.landmark for sighting in row) for row in known]


def _renamed(row: tuple[Sighting, ...], merged: dict[int, Merge]) -> tuple[Sighting, ...]:
    if not any(s.landmark in merged for s in row):
        return row
    return tuple(s.of_landmark(merged[s.landmark].into, np.eye(3)) if s.landmark in merged else s for s in row)


# What they say to a pose graph


class Marks(NamedTuple):
    """Sightings from ``nodes (m,)`` of ``landmarks (m,)`` at ``xyz (m, 3)`` in the node's camera, m.

    ``sigmas (m, 2)`` m across the line of sight and along it.
    """

    nodes: Array
    landmarks: Array
    xyz: Array
    sigmas: Array

    def taken(self, which: Array) -> Marks:
        """Those of a mask of which the landmark is seen from two nodes at least; no other ties anything."""
        left = Marks(*(part[which] for part in self))
        seen = Counter(number for _, number in set(zip(left.nodes.tolist(), left.landmarks.tolist(), strict=True)))
        many = np.array([seen[number] > 1 for number in left.landmarks.tolist()], bool)
        return Marks(*(part[many] for part in left))


def marks_of(graph: PoseGraph, shown: Sequence[Shown], names: Names, shares: Array = SHARES) -> Marks:
    """The sightings moved by odometry to the graph's nearest keyframes."""
    nodes, landmarks, xyz, sigmas = list[int](), list[int](), list[Array](), list[Array]()
    for one, numbers in zip(shown, names, strict=True):
        if not graph.odometry.covers(one.stamp_ns):
            continue
        k = graph.keyframes.nearest(one.stamp_ns)
        T_k_shown = inverse(graph.keyframes.poses[k]) @ graph.odometry.at(one.stamp_ns)
        nodes += [k] * len(numbers)
        landmarks += numbers
        xyz += list(transform(T_k_shown, one.xyz))
        sigmas += [np.hypot(LEAST_SIGMA_M, shares * sighting.extent) for sighting in one.sightings]
    marks = Marks(
        np.array(nodes, int),
        np.array(landmarks, int),
        np.array(xyz).reshape(-1, 3),
        np.array(sigmas).reshape(-1, 2),
    )
    return marks.taken(np.ones(len(nodes), bool))


def solved(dense: Dense, marks: Marks, picture_sigmas: tuple[float, float]) -> tuple[Array, int]:
    """The nodes (n, 4, 4) that agree best with steps, closures and landmarks, and how many sightings were left out.

    Closures and sightings are of pictures, each of which is off its node by ``picture_sigmas`` m and rad. All closures
    are believed.
    """
    poses, _ = _optimised(dense, _nothing(marks), picture_sigmas)
    if not len(marks.nodes):
        return poses[0], 0
    poses, middles = _optimised(dense, marks, picture_sigmas, poses[1])
    near = np.linalg.norm(_residuals(poses[1], middles, marks), axis=1) < LIMIT
    poses, _ = _optimised(dense, marks.taken(near), picture_sigmas, poses[1])
    return poses[0], int((~near).sum())


def _nothing(marks: Marks) -> Marks:
    return marks.taken(np.zeros(len(marks.nodes), bool))


def _optimised(
    dense: Dense, marks: Marks, picture_sigmas: tuple[float, float], start: Array | None = None
) -> tuple[Array, dict[int, Array]]:
    """``(2, n, 4, 4)``: nodes and their pictures; and the landmarks' places (3,) m."""
    n = len(dense.poses)
    pictures = dense.poses if start is None else start
    factors, values = factors_of(dense.between_pictures(n)), values_of(np.concatenate([pictures, pictures]))
    metres, radians = picture_sigmas
    same = gtsam.noiseModel.Diagonal.Sigmas(np.repeat([radians, metres], 3))
    for k in range(n):
        factors.add(gtsam.BetweenFactorPose3(k, n + k, gtsam.Pose3(), same))
    for number, place in _places(pictures, marks).items():
        values.insert(2 * n + number, place)
    for k, number, xyz, sigmas in zip(*(part.tolist() for part in marks), strict=True):
        factors.add(_sighting(n + k, 2 * n + number, np.array(xyz), *sigmas))
    found = gtsam.LevenbergMarquardtOptimizer(factors, values).optimize()
    T = np.array([found.atPose3(k).matrix() for k in range(2 * n)]).reshape(2, n, 4, 4)
    return T, {number: found.atPoint3(2 * n + number) for number in set(marks.landmarks.tolist())}


def _sighting(picture: int, landmark: int, xyz: Array, across: float, along: float) -> Any:
    metres = float(np.linalg.norm(xyz))
    noise = gtsam.noiseModel.Diagonal.Sigmas(np.array([across / metres, across / metres, along]))
    doubtful = gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.Huber.Create(HUBER), noise)
    return gtsam.BearingRangeFactor3D(picture, landmark, gtsam.Unit3(xyz), metres, doubtful)


def _places(pictures: Array, marks: Marks) -> dict[int, Array]:
    """The median of where each landmark is seen."""
    seen = defaultdict(list)
    for k, number, xyz in zip(marks.nodes.tolist(), marks.landmarks.tolist(), marks.xyz, strict=True):
        seen[number].append(transform(pictures[k], xyz))
    return {number: np.median(places, axis=0) for number, places in seen.items()}


def _residuals(pictures: Array, middles: dict[int, Array], marks: Marks) -> Array:
    """(m, 2) across and along the line of sight, in standard deviations."""
    expected = [
        transform(inverse(pictures[k]), middles[number])
        for k, number in zip(marks.nodes.tolist(), marks.landmarks.tolist(), strict=True)
    ]
    return _across_and_along(np.array(expected) - marks.xyz, marks.xyz) / marks.sigmas


def _across_and_along(errors: Array, xyz: Array) -> Array:
    """(m, 2) m of errors (m, 3) of what is seen at xyz (m, 3)."""
    along = np.einsum("mi,mi->m", errors, xyz / np.linalg.norm(xyz, axis=1, keepdims=True))
    across = np.sqrt(np.maximum(np.square(errors).sum(axis=1) - along**2, 0.0))
    return np.stack([across, along], axis=1)


# What the truth says


def exact(shown: Sequence[Shown], names: Names, truth: Truth) -> list[Shown]:
    """The same, with every landmark seen exactly where it is: in the middle of its sightings by the true poses."""
    places = _true_places(shown, names, truth)
    return [
        one
        if T is None or not numbers
        else replace(one, xyz=transform(inverse(T), np.array([places[number] for number in numbers])))
        for one, numbers in zip(shown, names, strict=True)
        for T in [truth.at(one.stamp_ns)]
    ]


def _true_places(shown: Sequence[Shown], names: Names, truth: Truth) -> dict[int, Array]:
    seen = defaultdict(list)
    for one, numbers in zip(shown, names, strict=True):
        if (T := truth.at(one.stamp_ns)) is not None:
            for number, place in zip(numbers, transform(T, one.xyz), strict=True):
                seen[number].append(place)
    return {number: np.median(places, axis=0) for number, places in seen.items()}


def wandering(shown: Sequence[Shown], names: Names, truth: Truth) -> dict[str, Any]:
    """How far objects are seen from the middle of all their sightings, by the true poses: medians.

    ``shares (2,)`` are standard deviations across the line of sight and along it, as shares of the extent.
    """
    middles, rows = exact(shown, names, truth), []
    counts = Counter(number for numbers in names for number in numbers)
    for one, other, numbers in zip(shown, middles, names, strict=True):
        if numbers and truth.at(one.stamp_ns) is not None:
            extents = [sighting.extent for sighting in one.sightings]
            errors = np.abs(_across_and_along(other.xyz - one.xyz, one.xyz))
            rows += [(*e, x) for e, x, n in zip(errors, extents, numbers, strict=True) if counts[n] > 1]
    across, along, extent = np.array(rows).reshape(-1, 3).T
    return {
        "sightings": len(rows),
        "landmarks": sum(count > 1 for count in counts.values()),
        "across_cm": 100 * float(np.median(across)),
        "along_cm": 100 * float(np.median(along)),
        "extent_cm": 100 * float(np.median(extent)),
        "shares": (np.median([across / extent, along / extent], axis=1) / MEDIANS).tolist(),
    }


# What is compared


@dataclass(frozen=True)
class Drifted:
    """A case with one drift."""

    case: Case
    shown: list[Shown]
    graph: PoseGraph

    def odometry(self, stamp_ns: int) -> Array | None:
        """The camera as odometry has it."""
        return self.graph.odometry.at(stamp_ns) if self.graph.odometry.covers(stamp_ns) else None

    def solved(
        self, names: Names, shares: Array = SHARES, closed: bool = True, is_exact: bool = False
    ) -> tuple[Array, int]:
        """Poses of the keyframes, and how many sightings were left out; no landmarks without names."""
        shown = exact(self.shown, names, self.case.truth) if is_exact else self.shown[: len(names)]
        dense, marks = Dense.of(self.graph), marks_of(self.graph, shown, names, shares)
        dense = dense if closed else dense._replace(closures=dense.closures.taken(slice(0)))
        return solved(dense, marks, self.graph.params.picture_sigmas)


def variants(drifted: Drifted) -> dict[str, Callable[[], tuple[Array, int]]]:
    """By name, what gives the poses."""
    case, shown = drifted.case, drifted.shown
    true, placed = named(shown, case.truth.at), named(shown, drifted.odometry)
    closed, both = named(shown, None, case.closures), named(shown, drifted.odometry, case.closures)
    with_name = _with_name(shown)
    named_ones = named(with_name, drifted.odometry, case.closures)
    real = np.array(wandering(shown, true, case.truth)["shares"])
    return {
        BASE: lambda: drifted.solved([]),
        "landmarks by place and closures": lambda: drifted.solved(both),
        "landmarks by place": lambda: drifted.solved(placed),
        "landmarks by closures": lambda: drifted.solved(closed),
        "landmarks by true places": lambda: drifted.solved(true),
        "by both, those with a name": lambda: replace(drifted, shown=with_name).solved(named_ones),
        "by both, half the sigmas": lambda: drifted.solved(both, SHARES / 2),
        "by both, twice the sigmas": lambda: drifted.solved(both, SHARES * 2),
        "by both, four times": lambda: drifted.solved(both, SHARES * 4),
        "by both, sigmas as they are": lambda: drifted.solved(both, real),
        "by place, no closures": lambda: drifted.solved(placed, closed=False),
        "by true places, seen exactly": lambda: drifted.solved(true, is_exact=True),
        "so, no closures": lambda: drifted.solved(true, closed=False, is_exact=True),
    }


def _with_name(shown: Sequence[Shown]) -> list[Shown]:
    which = [[k for k, sighting in enumerate(one.sightings) if sighting.label != UNNAMED] for one in shown]
    return [
        replace(one, xyz=one.xyz[those], sightings=tuple(one.sightings[k] for k in those))
        for one, those in zip(shown, which, strict=True)
    ]


def compare(case: Case, shown: list[Shown], drifts: int) -> dict[str, Any]:
    """The error of the keyframes' trajectory in cm, one for each drift, and how many sightings were left out."""
    cm, left_out = defaultdict[str, list[float]](list), defaultdict[str, list[int]](list)
    for seed in tqdm(range(1, drifts + 1), desc=case.name):
        graph, _ = filled(case, with_drift(case.frames, case.truth, seed), Variant(as_found))
        graph.optimise()
        cm[ODOMETRY].append(_error_cm(case, graph, graph.keyframes.poses))
        cm[OURS].append(_error_cm(case, graph, [T for _, T in graph.path()]))
        for name, solve in variants(Drifted(case, shown, graph)).items():
            poses, out = solve()
            cm[name].append(_error_cm(case, graph, poses))
            left_out[name].append(out)
    true = named(shown, case.truth.at)
    return {"closures": len(case.closures), **wandering(shown, true, case.truth), "cm": cm, "left_out": left_out}


def _error_cm(case: Case, graph: PoseGraph, poses: Iterable[Array]) -> float:
    pairs = [(T, case.truth.at(stamp)) for stamp, T in zip(graph.keyframes.stamps_ns, poses, strict=True)]
    known = [(T, there) for T, there in pairs if there is not None]
    return 100 * absolute_trajectory_error([T for T, _ in known], [there for _, there in known])


def table(name: str, figures: dict[str, Any]) -> str:
    """One recording as text: means over the drifts, in how many of these it is better than closures alone."""
    lines = [
        f"{name}: {figures['closures']} closures; {figures['sightings']} sightings of {figures['landmarks']} landmarks"
        f" of {figures['extent_cm']:.0f} cm, {figures['across_cm']:.1f} cm across and {figures['along_cm']:.1f} cm"
        f" along the line of sight from their middles (sigmas: {figures['shares'][0]:.2f} and"
        f" {figures['shares'][1]:.2f} of their extents)",
        f"{'':38} {'mean cm':>8} {'least':>7} {'most':>7} {'/ alone':>8} {'better':>7} {'left out':>9}",
    ]
    base = np.array(figures["cm"][BASE])
    for variant, values in figures["cm"].items():
        cm = np.array(values)
        out = f"{np.mean(figures['left_out'][variant]):.1f}" if variant in figures["left_out"] else "-"
        lines.append(
            f"{variant:38} {cm.mean():>8.2f} {cm.min():>7.2f} {cm.max():>7.2f} {cm.mean() / base.mean():>8.2f}"
            f" {(cm < base).sum():>4}/{len(cm):<2} {out:>9}"
        )
    return "\n".join(lines)
