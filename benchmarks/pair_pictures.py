# SPDX-License-Identifier: Apache-2.0
"""Pictures of the pairs that a method failed at."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np
from frame_pairs import Pair
from pair_figures import Row, is_wrong

from objreg_ros.data.checked import Array
from objreg_ros.data.images import DepthImage
from objreg_ros.geometry import back_project, transform
from objreg_tools.truth import LOOSE

MOST_FAILURES = 12  # that are drawn of one run


def picture(images: tuple[DepthImage, DepthImage], T_target_source: Array, text: str) -> Array:
    """Source, target, and the source's points painted into the target's picture, side by side, as BGR."""
    source, target = images
    assert source.rgb is not None and target.rgb is not None
    a, b = source.intrinsics, target.intrinsics
    points = back_project(source.depth, a.fx, a.fy, a.cx, a.cy)[source.depth > 0]
    moved = transform(T_target_source, points)
    colours, moved = source.rgb[source.depth > 0][moved[:, 2] > 0.2], moved[moved[:, 2] > 0.2]
    u, v = (b.fx * moved[:, 0] / moved[:, 2] + b.cx).astype(int), (b.fy * moved[:, 1] / moved[:, 2] + b.cy).astype(int)
    inside = (u >= 0) & (v >= 0) & (u < b.width) & (v < b.height)
    painted = target.rgb // 3
    order = np.argsort(-moved[inside, 2])
    painted[v[inside][order], u[inside][order]] = colours[inside][order]
    sheet = np.concatenate([source.rgb, target.rgb, painted], axis=1)[..., ::-1].copy()
    cv2.putText(sheet, text, (10, 30), cv2.FONT_HERSHEY_SIMPLEX, 0.8, (0, 255, 255), 2)
    return sheet


def draw_failures(
    folder: Path, pairs: Sequence[Pair], rows: Sequence[Row], image: Callable[[int], DepthImage | None]
) -> None:
    """The worst of a method as pictures: what was accepted and wrong first, then the largest errors."""
    folder.mkdir(parents=True, exist_ok=True)
    worth = [
        (is_wrong(p, r), p.could_close and not r.within(LOOSE), r.error[0] + r.error[1], k)
        for k, (p, r) in enumerate(zip(pairs, rows, strict=True))
        if r.error is not None and r.T is not None
    ]
    for wrong, failed, _, k in sorted(worth, reverse=True)[:MOST_FAILURES]:
        pair, row = pairs[k], rows[k]
        first, second = image(pair.source), image(pair.target)
        if not (wrong or failed) or row.T is None or row.error is None or first is None or second is None:
            continue
        text = f"{'ACCEPTED' if row.accepted else row.reason} {row.error[0]:.1f} deg {row.error[1]:.0f} cm"
        sheet = picture((first, second), row.T, f"{text}, turned {pair.turned:.0f} deg")
        cv2.imwrite(str(folder / f"{pair.source:04d}_{pair.target:04d}.jpg"), sheet)
