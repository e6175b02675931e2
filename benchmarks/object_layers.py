# SPDX-License-Identifier: Apache-2.0
"""Do the views of one object lie on each other? Its clouds of a recording, moved to the world by the true poses."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree
from sources import detector_of, read_source

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import ObjectCloud, PointFlag
from objreg_ros.geometry import transform

LABELS = ("cup", "chair", "book")
REACH = 0.15  # m: views whose middles are this near to each other are of one object
VIEWS = 12
CUT = PointFlag.CUT_BY_IMAGE | PointFlag.CUT_BY_BOX


def lay(recording: Path, model: str, json_path: Path | None) -> dict[str, Any]:
    """For each label the object that is seen most often: views, and the median distance between them in millimetres.

    The distance is that of a point to the nearest one of another view, where they overlap: within 5 cm. A picture with
    every view in its own colour, from above and from the side, goes beside ``json_path``.
    """
    with read_source(recording, detector_of(model), seed=0) as source:
        seen = [
            (transform(T, o.xyz), o, frame.stamp_ns)
            for frame in source.frames
            if (T := source.truth.at(frame.stamp_ns)) is not None
            for o in frame.objects
            if o.label in LABELS
        ]
    found: dict[str, Any] = {}
    layers: dict[str, list[Array]] = {}
    for label in LABELS:
        views = _most_seen([(xyz, o) for xyz, o, _ in seen if o.label == label])
        if len(views) < 2:
            continue
        layers[label] = [xyz for xyz, _ in views]
        found[label] = {"views": len(views), **_distances(layers[label])}
    if json_path is not None and layers:
        _draw(layers, found, json_path.with_suffix(".png"))
    return found


def _most_seen(views: list[tuple[Array, ObjectCloud]]) -> list[tuple[Array, ObjectCloud]]:
    """Up to VIEWS views, spread over time, of the place where most of them are; uncut ones where there are enough."""
    whole = [v for v in views if not (v[1].flags[0] & CUT)]
    views = whole if len(whole) >= VIEWS else views
    if not views:
        return []
    middles = np.array([np.median(xyz, axis=0) for xyz, _ in views])
    near = np.linalg.norm(middles[:, None] - middles[None], axis=-1) < REACH
    members = np.flatnonzero(near[near.sum(axis=1).argmax()])
    return [views[k] for k in members[np.linspace(0, len(members) - 1, min(VIEWS, len(members))).astype(int)]]


def _distances(clouds: list[Array]) -> dict[str, float]:
    trees = [cKDTree(cloud) for cloud in clouds]
    pairs = [(a, b) for a in range(len(clouds)) for b in range(len(clouds)) if a != b]
    near = [trees[b].query(clouds[a][::4], distance_upper_bound=0.05)[0] for a, b in pairs]
    joined = np.concatenate(near)
    overlap = np.isfinite(joined)
    return {
        "median_mm": round(1e3 * float(np.median(joined[overlap])), 2),
        "p90_mm": round(1e3 * float(np.percentile(joined[overlap], 90)), 2),
        "overlap": round(float(overlap.mean()), 3),
        "middles_cm": round(100 * _spread(clouds), 2),
    }


def _spread(clouds: list[Array]) -> float:
    middles = np.array([np.median(cloud, axis=0) for cloud in clouds])
    return float(np.median(np.linalg.norm(middles - np.median(middles, axis=0), axis=1)))


def _draw(layers: dict[str, list[Array]], found: dict[str, Any], path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(2, len(layers), figsize=(5 * len(layers), 9), squeeze=False)
    for column, (label, clouds) in enumerate(layers.items()):
        for row, (u, v) in enumerate(((0, 1), (0, 2))):
            plot = axes[row][column]
            for k, cloud in enumerate(clouds):
                plot.scatter(*cloud[::3, [u, v]].T, s=0.5, color=pyplot.cm.turbo(k / len(clouds)))
            plot.set_aspect("equal")
            plot.set_xlabel(f"{'xyz'[u]} of the world, m")
            plot.set_ylabel(f"{'xyz'[v]}, m")
        axes[0][column].set_title(f"{label}: {len(clouds)} views, median {found[label]['median_mm']} mm apart")
    figure.tight_layout()
    figure.savefig(path, dpi=80)
    pyplot.close(figure)
