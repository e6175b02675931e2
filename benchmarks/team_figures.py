# SPDX-License-Identifier: Apache-2.0
"""What a run of `team` came to: keyframes by robot, constraints by truth, and what two runs have in common."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
from robots import Team

from objreg_ros.data.closures import LoopClosure, robot_of
from objreg_ros.memory.store import Store
from objreg_tools.truth import FALSE, Truths, within

SAME_NS = 1_000_000_000


def figures_of(
    team: Team, status: Mapping[str, Mapping[str, str]], received: Mapping[str, Any], store: Path
) -> dict[str, Any]:
    """What a run came to."""
    here = status["registrar"]
    stored = stored_keyframes(store)
    count = lambda robot, what: int(here.get(f"{robot}: keyframes {what}", 0))  # noqa: E731
    robots = {
        robot: {
            "frames": int(status[f"{robot}/keyframer"]["published"]),
            "sent": int(status[f"{robot}/keyframer"]["keyframes sent"]),
            **{what: count(robot, what) for what in ("received", "searched", "stored unsearched")},
            "kilobytes": float(status[f"{robot}/keyframer"].get("kilobytes a keyframe", "nan")),
            "kept": sum(of == robot for of, _ in stored),
            "kept twice": sum(n - 1 for (of, _), n in stored.items() if of == robot),
        }
        for robot in team
    }
    stages = {
        stage: [float(here.get(f"latency {stage} {share} [ms]", "nan")) for share in ("p50", "p95")]
        for stage in ("search", "wait", "total")
    }
    dropped = {
        node: {key: int(value) for key, value in values.items() if key.startswith(("dropped: ", "lost in"))}
        for node, values in status.items()
    }
    truths = Truths({name: robot.truth for name, robot in team.items()})
    found = [closure_of(row, list(team)) for row in received["closures"]]
    errors = [(closure, error) for closure in found if (error := truths.error(closure)) is not None]
    wrong = [closure for closure, error in errors if not within(error, FALSE)]
    return {
        "robots": robots,
        "ms": stages,
        "hurried": received["hurried"] - sum(n["stored unsearched"] for n in robots.values()),
        "refused": {key.split()[1]: int(value) for key, value in here.items() if key.startswith("rejected: ")},
        "dropped": {node: counts for node, counts in dropped.items() if counts},
        "closures": len(found),
        "false": len(wrong),
        "between": sum(closure.from_robot != closure.to_robot for closure in found),
        "between_false": sum(closure.from_robot != closure.to_robot for closure in wrong),
        "moments": [[*closure.robots, closure.from_ns, closure.to_ns] for closure in found],
    }


def stored_keyframes(path: Path) -> Counter[tuple[str, int]]:
    """How often each keyframe is in the store, by its robot and stamp."""
    with closing(Store(path, read_only=True)) as store:
        return Counter((k.robot, k.stamp_ns) for k in map(store.keyframe, store.keyframe_ids()))


def closure_of(row: Mapping[str, Any], robots: Sequence[str]) -> LoopClosure:
    """The closure that the witness wrote down, with its robots by its frames."""
    (from_frame, from_ns), (to_frame, to_ns) = row["from"], row["to"]
    return LoopClosure(
        from_ns=from_ns,
        to_ns=to_ns,
        T_from_to=np.array(row["T_from_to"]),
        covariance=np.eye(6),
        labels=(),
        from_frame_id=from_frame,
        to_frame_id=to_frame,
        from_robot=robot_of(from_frame, robots),
        to_robot=robot_of(to_frame, robots),
    )


Moments = Sequence[Any]  # two robots and two stamps


def in_common(one: Sequence[Moments], other: Sequence[Moments]) -> int:
    """How many of one have a like in the other: the same two moments, whichever is called from; each counts once."""
    left, found = list(other), 0
    for moments in one:
        like = next((candidate for candidate in left if are_alike(moments, candidate)), None)
        if like is not None:
            left.remove(like)
            found += 1
    return found


def are_alike(one: Moments, other: Moments) -> bool:
    """Whether both ends are of the same robots, and a second apart at most."""
    a, b = (one[0], one[2]), (one[1], one[3])
    ends = ((other[0], other[2]), (other[1], other[3]))
    return any(
        all(p[0] == q[0] and abs(p[1] - q[1]) <= SAME_NS for p, q in zip((a, b), order, strict=True))
        for order in (ends, ends[::-1])
    )


def table_of(name: str, row: Mapping[str, Any]) -> str:
    """A run in a few lines."""
    lines = [
        f"{name}: {row['seconds']:.0f} s, load before and after {row['load'][0]:.1f}, {row['load'][1]:.1f}, "
        f"processor in percent of one core: {row['percent']}, all others together {row['others_percent']}"
    ]
    for robot, n in row["robots"].items():
        share = n["searched"] / n["sent"] if n["sent"] else float("nan")
        lines.append(
            f"  {robot}: {n['frames']} frames, keyframes sent {n['sent']}, received {n['received']}, searched "
            f"{n['searched']} ({share:.2f}), unsearched {n['stored unsearched']}, kept {n['kept']} "
            f"({n['kept twice']} twice), {n['kilobytes']} kB each"
        )
    lines.append(f"  searches cut short: {row['hurried']}; refused: {row['refused']}")
    stages = ", ".join(f"{stage} {p50:.0f} / {p95:.0f} ms" for stage, (p50, p95) in row["ms"].items())
    lines.append(f"  p50 / p95: {stages}; dropped: {row['dropped'] or 'nothing'}; settled: {row['settled']}")
    lines.append(
        f"  constraints {row['closures']} ({row['false']} false), between robots {row['between']} "
        f"({row['between_false']} false); last keyframes that came at the end: {row['last']} of {len(row['robots'])}"
    )
    if "common" in row:
        lines.append(f"  in common with the first run: {row['common']} of its {row['common_of']}")
    return "\n".join(lines)
