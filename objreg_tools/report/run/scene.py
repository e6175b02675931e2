# SPDX-License-Identifier: Apache-2.0
"""The trajectories, the closures and the objects of a run in 3D, for a drawing that a reader can turn."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import UNNAMED
from objreg_ros.geometry import pose, transform
from objreg_tools.report.packed import packed
from objreg_tools.report.run import figures
from objreg_tools.report.run.run_summary import RunSummary, Tracks

MOST_POSES = 5000  # of one trajectory
MOST_SIGHTINGS = 20_000  # of all objects
NEAR_AXIS = np.cos(np.radians(30))  # of the mean up of a camera: a frame's axis so near is what is up
NAMES = {"true": "truth", "tracked": "our own tracking"}
APART_M = 0.4  # names nearer than this would cover each other


def scene(run: RunSummary, stamps_ns: Array, lines: Mapping[str, Array], tracks: Tracks | None) -> dict[str, Any]:
    """Trajectories (N, 3) by name, the closures on the last of them, and objects of the map: packed points, z is up."""
    T_level_drawn = _levelling(run, stamps_ns, tracks)
    flat = {name: transform(T_level_drawn, xyz) for name, xyz in lines.items()}
    step = -(-len(stamps_ns) // MOST_POSES)
    last = list(flat.values())[-1]
    seen = [] if tracks is None else run.objects()
    kept = seen[:: -(-len(seen) // MOST_SIGHTINGS) or 1]
    T_level_map = T_level_drawn if tracks is None else T_level_drawn @ tracks.T_drawn_map
    at = transform(T_level_map, np.array([row[2] for row in kept])) if kept else np.zeros((0, 3))
    return {
        "trajectories": [
            {"name": NAMES.get(name, name), "style": name, **packed(xyz[::step])} for name, xyz in flat.items()
        ],
        "closures": _closures(run, stamps_ns, last),
        **_objects([row[0] for row in kept], at),
        "text": f"Of {len(seen)} sightings of objects {len(kept)} are shown." if len(kept) < len(seen) else "",
    }


def _levelling(run: RunSummary, stamps_ns: Array, tracks: Tracks | None) -> Array:
    """The rotation (4, 4) that turns the frame of the drawing until z is up, by some of the poses."""
    stamps_ns = stamps_ns[:: len(stamps_ns) // 100 or 1]
    if tracks is None:
        poses = [T for stamp in stamps_ns if (T := run.truth.at(int(stamp))) is not None]
        if not poses and (tracked := run.tracked_trajectory()) is not None:
            poses = list(tracked[1])
    else:
        mapped = {frame.stamp_ns: frame.T_map_camera for frame in run.map.frames}
        poses = [tracks.T_drawn_map @ mapped[stamp] for stamp in stamps_ns.tolist()]
    return levelling(np.array(poses).reshape(-1, 4, 4))


def levelling(poses: Array) -> Array:
    """The rotation (4, 4) that turns the mean up direction of cameras at poses (N, 4, 4) to z.

    An axis of their frame is taken as up where it is near. Where cameras have no up in common, nothing is turned.
    """
    mean = -poses[:, :3, 1].mean(axis=0)
    length = np.linalg.norm(mean)
    if not length > 0.2:
        return np.eye(4)
    up, axis = mean / length, np.abs(mean).argmax()
    if abs(up[axis]) > NEAR_AXIS:
        up = np.sign(up[axis]) * np.eye(3)[axis]
    level = np.eye(3)[np.abs(up).argmin()]
    right = level - (level @ up) * up
    right /= np.linalg.norm(right)
    return pose(np.array([right, np.cross(up, right), up]), np.zeros(3))


def _closures(run: RunSummary, stamps_ns: Array, trajectory: Array) -> list[dict[str, Any]]:
    """The closures by verdict and by whether the mapper pruned them, with the key and the text of each."""
    pruned = {id(closure) for closure in run.pruned}
    groups: dict[tuple[str, bool], list[int]] = {}
    for k, closure in enumerate(run.closures):
        groups.setdefault((figures.verdict(run, closure), id(closure) in pruned), []).append(k)
    return [
        {
            "style": style,
            "pruned": is_pruned,
            "name": " ".join(["pruned"] * is_pruned + ["false"] * (style == "false") + ["closure"]),
            "keys": [f"c{k}" for k in members],
            "text": [figures.closure_text(run, run.closures[k]) for k in members],
            **packed(np.concatenate([figures.ends(run.closures[k], stamps_ns, trajectory) for k in members])),
        }
        for (style, is_pruned), members in sorted(groups.items())
    ]


def _objects(labels: list[str], xyz: Array) -> dict[str, Any]:
    """The sightings in the colours of the object map, and the names of what was seen often."""
    order = [label for label, _ in Counter(labels).most_common()]
    own, shared = order[: figures.SERIES - 1], order[figures.SERIES - 1 :]
    groups = [(label, [label]) for label in own] + (
        [(shared[0] if len(shared) == 1 else "others", shared)] if shared else []
    )
    names = _names(labels, xyz)
    return {
        "objects": [
            {"name": name, "style": f"s{k}", **packed(xyz[np.isin(labels, members)])}
            for k, (name, members) in enumerate(groups)
        ],
        "names": {"text": [label for label, _ in names], **packed(np.array([at for _, at in names]).reshape(-1, 3))},
    }


def _names(labels: list[str], xyz: Array) -> list[tuple[str, Array]]:
    """The names of clusters that are apart; an unnamed object has one only where nothing else is."""
    kept: list[tuple[str, Array]] = []
    for label, at in sorted(figures.clusters(labels, xyz), key=lambda cluster: cluster[0] == UNNAMED):
        if all(np.linalg.norm(at - other) > APART_M for _, other in kept):
            kept.append((label, at))
    return kept
