# SPDX-License-Identifier: Apache-2.0
"""The methods that close loops, each on a whole recording, and what the truth says of their constraints."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from peers import Peer
from sources import Source

from objreg_mapper.pose_graph import PoseGraph
from objreg_ros.data.checked import Array
from objreg_ros.data.closure_fields import fields_of
from objreg_ros.data.closures import UNTRIED, LoopClosure
from objreg_ros.data.frames import Frame, Odometry
from objreg_ros.geometry import inverse, rotation_angle
from objreg_ros.registrar.outcome import Outcome
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.registrar import Registrar
from objreg_tools.report.run.revisits import Revisit, SeenPlace, recall_by_view_change, revisits
from objreg_tools.report.run.trajectory_error import absolute_trajectory_error
from objreg_tools.truth import FALSE, LOOSE, Truth, within

GAP_NS = 2_000_000_000  # what is nearer in time is no loop
TOLERANCE_NS = 1_000_000_000  # a keyframe spans up to a second
KEYFRAME_MOTION = (0.15, 8.0)  # m, degrees: as often as the registrar by default
AHEAD = np.array([0.0, 0.0, 1.2, 1.0])  # what a camera looks at, about
PEER_COVARIANCE = np.diag([0.05**2] * 3 + [np.radians(2.0) ** 2] * 3)
ORACLE_COVARIANCE = np.diag([0.005**2] * 3 + [np.radians(0.2) ** 2] * 3)


@dataclass
class Result:
    """What one method made of one recording; seconds are the processor's, so that a busy machine gives the same."""

    closures: list[LoopClosure]
    pairs: int
    seconds: float
    prepare_seconds: float = 0.0
    refused: Counter[str] = field(default_factory=Counter)  # by reason


def ours(source: Source, seed: int, **other: float) -> Result:
    """The registrar, frame by frame, with ``other`` values of its parameters."""
    params = RegistrarParams(seed=seed).replaced(**source.camera, **other)
    registrar = Registrar(params)
    result = Result([], 0, 0.0)
    start = time.process_time()
    for frame in source.frames:
        _note(result, registrar.process(frame))
    _note(result, registrar.finish())
    result.seconds = time.process_time() - start
    registrar.close()
    return result


def _note(result: Result, outcome: Outcome) -> None:
    result.closures += outcome.closures
    result.pairs += len(outcome.closures) + sum(r.reason not in UNTRIED for r in outcome.rejected)
    result.refused.update(refusal.reason.value for refusal in outcome.rejected)


def oracle(source: Source, found: Sequence[Revisit]) -> Result:
    """A perfect constraint for every revisit: what is left of the trajectory's error then, no method can take away."""
    answers = [
        (revisit.from_ns, revisit.to_ns, source.truth.between(revisit.from_ns, revisit.to_ns)) for revisit in found
    ]
    return Result([perfect(a, b, T) for a, b, T in answers if T is not None], len(answers), 0.0)


def perfect(from_ns: int, to_ns: int, T_from_to: Array) -> LoopClosure:
    """A true pose as a constraint that is known well."""
    return _closure(from_ns, to_ns, T_from_to, ORACLE_COVARIANCE)


def theirs(peer: Peer, source: Source, keyframes: Sequence[Frame], pairs: Sequence[tuple[int, int]]) -> Result:
    """A peer on pairs of keyframes (earlier, later)."""
    result = Result([], len(pairs), 0.0)
    used = sorted({k for pair in pairs for k in pair})
    prepared = {}
    for k in used:
        shot = source.shot(keyframes[k])
        start = time.process_time()
        prepared[k] = peer.prepare(shot)
        result.prepare_seconds += time.process_time() - start
    for a, b in pairs:
        start = time.process_time()
        answer = peer.register(prepared[a], prepared[b])
        result.seconds += time.process_time() - start
        if answer is not None and answer.accepted:
            moments = keyframes[a].stamp_ns, keyframes[b].stamp_ns
            result.closures.append(_closure(*moments, answer.T_from_to, PEER_COVARIANCE))
    return result


def _closure(from_ns: int, to_ns: int, T_from_to: Array, covariance: Array) -> LoopClosure:
    return LoopClosure(from_ns=from_ns, to_ns=to_ns, T_from_to=T_from_to, covariance=covariance, labels=())


def keyframes_of(frames: Sequence[Frame]) -> list[Frame]:
    """Frames that are apart by `KEYFRAME_MOTION` in odometry."""
    kept: list[Frame] = []
    for frame in frames:
        if frame.T_odom_camera is None:
            continue
        if kept and kept[-1].T_odom_camera is not None:
            motion = inverse(kept[-1].T_odom_camera) @ frame.T_odom_camera
            near = np.linalg.norm(motion[:3, 3]) < KEYFRAME_MOTION[0]
            if near and np.degrees(rotation_angle(motion[:3, :3])) < KEYFRAME_MOTION[1]:
                continue
        kept.append(frame)
    return kept


def loops_of(keyframes: Sequence[Frame], truth: Truth) -> list[Revisit]:
    """The revisits that there were to close, by truth."""
    return revisits(
        [SeenPlace(f.stamp_ns, f.view, T) for f in keyframes if (T := truth.at(f.stamp_ns)) is not None], GAP_NS
    )


def candidate_pairs(keyframes: Sequence[Frame], most: int) -> list[tuple[int, int]]:
    """For every keyframe the earlier ones that by odometry look at the nearest place, as every SLAM proposes them."""
    looked_at = [T @ AHEAD for T in (keyframe.T_odom_camera for keyframe in keyframes) if T is not None]
    pairs = []
    for b, later in enumerate(keyframes):
        earlier = [a for a in range(b) if later.stamp_ns - keyframes[a].stamp_ns >= GAP_NS]
        earlier.sort(key=lambda a: float(np.linalg.norm(looked_at[a] - looked_at[b])))
        pairs += [(a, b) for a in earlier[:most]]
    return pairs


def judged(result: Result, source: Source, found: Sequence[Revisit]) -> dict[str, Any]:
    """A method's result against the truth."""
    truth = source.truth
    errors = truth.errors(result.closures)
    recall = recall_by_view_change(found, result.closures, truth, TOLERANCE_NS)
    before, after, pruned = trajectory_errors(source.frames, result.closures, truth)
    return {
        "constraints": len(result.closures),
        "true": sum(within(error, LOOSE) for error in errors),
        "false": sum(not within(error, FALSE) for error in errors),
        "recall": {name: {"closed": closed, "of": of} for name, (closed, of) in recall.items()},
        "pairs": result.pairs,
        "ms_per_pair": round(1e3 * result.seconds / max(result.pairs, 1), 2),
        "prepare_seconds": round(result.prepare_seconds, 2),
        "ate_cm": {"before": round(100 * before, 2), "after": round(100 * after, 2)},
        "ate_reduced": round(1 - after / before, 3) if before else 0.0,
        "pruned": pruned,
        "refused": dict(sorted(result.refused.items())),
        "rotation_deg": _median([error[0] for error in errors]),
        "translation_cm": _median([error[1] for error in errors]),
        "closures": [fields_of(closure) for closure in result.closures],
    }


def _median(values: Sequence[float]) -> float | None:
    return round(float(np.median(values)), 3) if values else None


def trajectory_errors(
    frames: Sequence[Frame], closures: Sequence[LoopClosure], truth: Truth
) -> tuple[float, float, int]:
    """The trajectory error in m by odometry and in the map, and how many closures the map pruned."""
    posed = [(frame.stamp_ns, T) for frame in frames if (T := frame.T_odom_camera) is not None]
    graph = PoseGraph()
    for stamp_ns, T_odom_camera in posed:
        graph.add_odometry(Odometry(T_odom_body=T_odom_camera, stamp_ns=stamp_ns))
    for closure in closures:
        graph.add_closure(closure)
    pruned = len(graph.optimise().pruned)
    known = [(stamp, T, there) for stamp, T in posed if (there := truth.at(stamp)) is not None]
    true = [row[2] for row in known]
    before = absolute_trajectory_error([row[1] for row in known], true)
    after = absolute_trajectory_error(graph.corrected(row[0] for row in known), true)
    return before, after, pruned
