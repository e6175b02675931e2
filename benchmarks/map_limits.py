# SPDX-License-Identifier: Apache-2.0
"""What limits the trajectory of a recording: closures found once, odometry that drifts anew, parts left out."""

from __future__ import annotations

import hashlib
import os
import pickle
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import click
import closers
import numpy as np
from sources import detector_of, read_source, with_drift
from tqdm import tqdm

from objreg_mapper.params import MapperParams
from objreg_mapper.pose_graph import PoseGraph
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import Frame, Odometry
from objreg_ros.geometry import inverse, rotation_angle, vector_from_rotation
from objreg_ros.whole_file import write_whole
from objreg_tools.report.run.trajectory_error import absolute_trajectory_error
from objreg_tools.truth import LOOSE, Truth, within

SEED = 1  # of the odometry with which closures are found
PERFECT, OURS, ODOMETRY = "perfect constraints", "ours", "odometry alone"
NO_STEADY = {"steady_heading": 0.0, "steady_distance": 0.0}
NEVER_PRUNED = {"max_residual": 1e3}
STRETCHES_M = (0.5, 2.0, 4.0)
WANDERING = {"odometry_translation_error": 0.014, "odometry_rotation_error": 0.32}  # of `with_drift`, by its model
MOST_REVISITS = 200  # of all that there are, evenly


@dataclass(frozen=True)
class Case:
    """A recording without its pictures: what its frames, its truth and the registrar came to."""

    name: str
    frames: list[Frame]
    truth: Truth
    closures: list[LoopClosure]


def require_own(folder: Path) -> None:
    """Make a folder that only this user writes; `click.ClickException` for one of another: what it has may be code."""
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    status = folder.stat()
    if status.st_uid != os.getuid() or status.st_mode & 0o022:
        raise click.ClickException(f"{folder}: expected a folder that only you write, got another; choose by --keep")


def kept(path: Path, folder: Path, make: Callable[[], Any], suffix: str = ".pickle") -> Any:
    """What is made of a recording; out of a file in the folder where it was made before."""
    require_own(folder)
    stat = path.stat()
    tag = hashlib.sha1(f"{path.resolve()} {stat.st_mtime_ns} {stat.st_size}".encode()).hexdigest()[:8]
    file = folder / f"{path.name}_{tag}{suffix}"
    if file.exists():
        click.echo(f"{path.name}: as found before, in {file}", err=True)
        return pickle.loads(file.read_bytes())
    made = make()
    write_whole(file, pickle.dumps(made))
    return made


def found(path: Path, folder: Path) -> Case:
    """Of a recording; out of a file where it was found before."""
    case: Case = kept(path, folder, lambda: _found(path))
    return case


def _found(path: Path) -> Case:
    click.echo(f"{path.name}: finding closures", err=True)
    with read_source(path, detector_of(), SEED) as source:
        result = closers.ours(source, SEED)
        bare = [
            replace(frame, objects=(), support=None)
            for frame in source.frames
            if source.truth.at(frame.stamp_ns) is not None
        ]
        return Case(path.name, bare, source.truth, result.closures)


ClosuresOf = Callable[[Case, list[Frame]], list[LoopClosure]]


@dataclass(frozen=True)
class Variant:
    """Closures made of those that were found, and parameters of the mapper."""

    closures: ClosuresOf
    params: MapperParams = MapperParams()


def as_found(case: Case, _: list[Frame]) -> list[LoopClosure]:
    """Those that the registrar published."""
    return case.closures


def perfect(case: Case, _: list[Frame]) -> list[LoopClosure]:
    """The same pairs with true poses."""
    return [replace(closure, T_from_to=T) for closure, T in _with_truth(case)]


def rotations_perfect(case: Case, _: list[Frame]) -> list[LoopClosure]:
    """The same pairs, their rotations true."""
    return [replace(closure, T_from_to=_mixed(T, closure.T_from_to)) for closure, T in _with_truth(case)]


def positions_perfect(case: Case, _: list[Frame]) -> list[LoopClosure]:
    """The same pairs, their positions true."""
    return [replace(closure, T_from_to=_mixed(closure.T_from_to, T)) for closure, T in _with_truth(case)]


def _mixed(rotation_of: Array, position_of: Array) -> Array:
    T = position_of.copy()
    T[:3, :3] = rotation_of[:3, :3]
    return T


def _with_truth(case: Case) -> list[tuple[LoopClosure, Array]]:
    pairs = [(closure, case.truth.between(closure.from_ns, closure.to_ns)) for closure in case.closures]
    return [(closure, T) for closure, T in pairs if T is not None]


def true_ones(case: Case, _: list[Frame]) -> list[LoopClosure]:
    """Those within 5 degrees and 10 cm."""
    errors = [(closure, case.truth.error(closure)) for closure in case.closures]
    return [closure for closure, error in errors if error is not None and within(error, LOOSE)]


def every_revisit(case: Case, frames: list[Frame]) -> list[LoopClosure]:
    """Perfect constraints for pairs of keyframes that there were to close, known to 5 mm and 0.2 degrees."""
    closures = []
    revisits = closers.loops_of(closers.keyframes_of(frames), case.truth)
    for revisit in revisits[:: len(revisits) // MOST_REVISITS + 1]:
        T = case.truth.between(revisit.from_ns, revisit.to_ns)
        if T is not None:
            closures.append(closers.perfect(revisit.from_ns, revisit.to_ns, T))
    return closures


def scaled(factor: float) -> ClosuresOf:
    """All covariances by a factor."""
    return lambda case, _: [replace(closure, covariance=factor * closure.covariance) for closure in case.closures]


def alike() -> ClosuresOf:
    """All covariances the same: the middle one of position, and of rotation."""

    def made(case: Case, _: list[Frame]) -> list[LoopClosure]:
        variances = np.median([np.diag(closure.covariance) for closure in case.closures], axis=0)
        C = np.diag(np.repeat([variances[:3].mean(), variances[3:].mean()], 3))
        return [replace(closure, covariance=C) for closure in case.closures]

    return made


def thinned(metres: float) -> ClosuresOf:
    """Closures between the same two stretches of the way share what one of them knows; a radian counts as a metre."""

    def made(case: Case, frames: list[Frame]) -> list[LoopClosure]:
        closures, stamps, way = case.closures, np.array([frame.stamp_ns for frame in frames]), _way(frames)
        ends = [
            tuple(int(np.interp(stamp, stamps, way) / metres) for stamp in (closure.from_ns, closure.to_ns))
            for closure in closures
        ]
        count = Counter(ends)
        return [
            replace(closure, covariance=count[end] * closure.covariance)
            for closure, end in zip(closures, ends, strict=True)
        ]

    return made


def _way(frames: Sequence[Frame]) -> Array:
    """How far odometry went until each frame, m and rad together."""
    poses = [frame.T_odom_camera for frame in frames if frame.T_odom_camera is not None]
    steps = [inverse(a) @ b for a, b in pairwise(poses)]
    return np.cumsum([0.0, *(float(np.linalg.norm(T[:3, 3])) + rotation_angle(T[:3, :3]) for T in steps)])


def pictures(factor: float) -> dict[str, float]:
    """So many times the error that closures of a keyframe share."""
    metres, radians = MapperParams().picture_sigmas
    return {
        "picture_translation_error": factor * metres,
        "picture_rotation_error": factor * float(np.degrees(radians)),
    }


def variants() -> dict[str, Variant]:
    """What is compared, by name."""
    usual = MapperParams()
    steadfast, patient = usual.replaced(**NO_STEADY), usual.replaced(**NEVER_PRUNED)
    trusted = usual.replaced(**WANDERING)
    return {
        OURS: Variant(as_found),
        PERFECT: Variant(perfect),
        "perfect, any revisits": Variant(every_revisit),
        "ours, rotations perfect": Variant(rotations_perfect),
        "ours, positions perfect": Variant(positions_perfect),
        "ours, true ones alone": Variant(true_ones),
        "ours, none pruned": Variant(as_found, patient),
        "ours, no steady error": Variant(as_found, steadfast),
        "ours, nothing shared": Variant(as_found, usual.replaced(**pictures(0.0))),
        "ours, twice as much shared": Variant(as_found, usual.replaced(**pictures(2.0))),
        "perfect, nothing shared": Variant(perfect, usual.replaced(**pictures(0.0))),
        **{f"ours, shared by {m:g} m": Variant(thinned(m)) for m in STRETCHES_M},
        "ours, covariance x 4": Variant(scaled(4.0)),
        "ours, covariance x 16": Variant(scaled(16.0)),
        "ours, covariances alike": Variant(alike()),
        "ours, odometry as it is": Variant(as_found, trusted),
        "perfect, odometry as it is": Variant(perfect, trusted),
        "ours, 2 m and odometry": Variant(thinned(STRETCHES_M[1]), trusted),
    }


def limits(case: Case, drifts: int) -> dict[str, Any]:
    """The error of the trajectory in cm by odometry and with each variant, one for each drift."""
    cm: dict[str, list[float]] = {ODOMETRY: []}
    pruned: dict[str, list[int]] = {}
    for seed in tqdm(range(1, drifts + 1), desc=case.name):
        frames = with_drift(case.frames, case.truth, seed)
        for name, variant in variants().items():
            before, after, refused = trajectory_errors(case, frames, variant)
            cm.setdefault(name, []).append(100 * after)
            pruned.setdefault(name, []).append(refused)
        cm[ODOMETRY].append(100 * before)
    return {"closures": len(case.closures), "cm": cm, "pruned": pruned, **consistency(case)}


def filled(case: Case, frames: list[Frame], variant: Variant) -> tuple[PoseGraph, int]:
    """A graph with all of it, unsolved, and how many closures it refused."""
    graph, refused = PoseGraph(variant.params), 0
    for frame in frames:
        if frame.T_odom_camera is not None:
            graph.add_odometry(Odometry(T_odom_body=frame.T_odom_camera, stamp_ns=frame.stamp_ns))
    for closure in variant.closures(case, frames):
        try:
            graph.add_closure(closure)
        except ValueError:
            refused += 1
    return graph, refused


def trajectory_errors(case: Case, frames: list[Frame], variant: Variant) -> tuple[float, float, int]:
    """As `closers.trajectory_errors`, with parameters; what the mapper refuses at once counts as pruned."""
    graph, refused = filled(case, frames, variant)
    posed = [(frame.stamp_ns, T) for frame in frames if (T := frame.T_odom_camera) is not None]
    pruned = len(graph.optimise().pruned) + refused
    true = [T for stamp, _ in posed if (T := case.truth.at(stamp)) is not None]
    before = absolute_trajectory_error([T for _, T in posed], true)
    return before, absolute_trajectory_error(graph.corrected(stamp for stamp, _ in posed), true), pruned


def consistency(case: Case) -> dict[str, Any]:
    """What closures err, and what they claim: medians, and the middle squared error in variances (right: 0.89).

    ``shared`` is the part of the squared error that closures between the same two stretches of 2 s have in common: 0 of
    independent ones, 1 where they all err alike.
    """
    rows = _with_truth(case)
    errors = np.array([_error(closure, T) for closure, T in rows]).reshape(-1, 6)
    white = np.array(
        [e @ np.linalg.solve(closure.covariance, e) / 6 for e, (closure, _) in zip(errors, rows, strict=True)]
    )
    claimed = np.array([np.sqrt(np.diag(closure.covariance)) for closure, _ in rows]).reshape(-1, 6)
    groups: dict[tuple[int, int], list[Array]] = {}
    for e, (closure, _) in zip(errors, rows, strict=True):
        groups.setdefault((closure.from_ns // 2_000_000_000, closure.to_ns // 2_000_000_000), []).append(e[:3])
    many = [np.array(group) for group in groups.values() if len(group) > 1]
    pairs = sum(len(g) * (len(g) - 1) for g in many)
    products = sum(float(np.square(g.sum(axis=0)).sum() - np.square(g).sum()) for g in many)
    alone = sum((len(g) - 1) * float(np.square(g).sum()) for g in many)
    return {
        "error_cm": 100 * float(np.median(np.linalg.norm(errors[:, :3], axis=1))),
        "error_deg": float(np.degrees(np.median(np.linalg.norm(errors[:, 3:], axis=1)))),
        "claimed_cm": 100 * float(np.median(np.linalg.norm(claimed[:, :3], axis=1))),
        "claimed_deg": float(np.degrees(np.median(np.linalg.norm(claimed[:, 3:], axis=1)))),
        "squared_in_variances": float(np.median(white)),
        "shared": products / alone if pairs else None,
    }


def _error(closure: LoopClosure, T: Array) -> Array:
    """[t r] in the axes of *from*."""
    turned = vector_from_rotation(closure.T_from_to[:3, :3] @ T[:3, :3].T)
    return np.concatenate([closure.T_from_to[:3, 3] - T[:3, 3], turned])


def table(name: str, figures: dict[str, Any]) -> str:
    """One recording as text: means over the drifts, and the ratio to perfect constraints, drift by drift."""
    lines = [
        f"{name}: {figures['closures']} closures that err {figures['error_cm']:.2f} cm and {figures['error_deg']:.2f}"
        f" deg, and claim {figures['claimed_cm']:.2f} cm and {figures['claimed_deg']:.2f} deg; squared in variances"
        f" {figures['squared_in_variances']:.2f}; shared "
        + ("-" if figures["shared"] is None else f"{figures['shared']:.2f}"),
        f"{'':38} {'mean cm':>8} {'least':>7} {'most':>7} {'/ perfect':>10} {'worst':>6} {'pruned':>7}",
    ]
    base = np.array(figures["cm"][PERFECT])
    for variant, values in figures["cm"].items():
        cm = np.array(values)
        pruned = f"{np.mean(figures['pruned'][variant]):.1f}" if variant in figures["pruned"] else "-"
        lines.append(
            f"{variant:38} {cm.mean():>8.2f} {cm.min():>7.2f} {cm.max():>7.2f} {cm.mean() / base.mean():>10.2f}"
            f" {(cm / base).max():>6.2f} {pruned:>7}"
        )
    return "\n".join(lines)
