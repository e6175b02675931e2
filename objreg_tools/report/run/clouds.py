# SPDX-License-Identifier: Apache-2.0
"""The clouds of all pairs of a run, as many as a page can carry."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Container, Iterable
from dataclasses import dataclass, field
from math import ceil, sqrt
from typing import Any

import numpy as np

from objreg_ros.data.images import DepthImage
from objreg_tools.report.packed import MOST, zipped
from objreg_tools.report.run.pairs import PairRow, by_interest
from objreg_tools.report.run.pictures import Album

PAGE_BYTES = 4_000_000  # of all clouds of a page; that of one run has 15 MB for everything
MOST_POINTS = 64 * 48  # of one cloud
STEP_M = 0.001  # of depth, where nothing is farther than 65 m
LEFT_OUT = "left out, as the page would grow too large"


@dataclass
class Clouds:
    """``moments`` by stamp, the depth of each, and ``poses`` by the key of a pair: T_from_to (3, 4), row by row.

    ``absent`` says of each pair with a pose but without clouds, by its key, why there are none.
    """

    moments: dict[str, dict[str, Any]] = field(default_factory=dict)
    poses: dict[str, list[float]] = field(default_factory=dict)
    absent: dict[str, str] = field(default_factory=dict)
    size: int = 0

    def add_pair(self, pair: PairRow, album: Album, pictured: Container[int], most_bytes: int) -> None:
        """Both clouds of a pair and its pose, or why they are absent."""
        stamps_ns = (pair.outcome.from_ns, pair.outcome.to_ns)
        seen = {stamp_ns: image for stamp_ns in stamps_ns if (image := album.at(stamp_ns)) is not None}
        whys = [why for stamp_ns in stamps_ns if (why := _lacking(seen.get(stamp_ns), album.lacking(stamp_ns)))]
        if whys or pair.outcome.T_from_to is None:
            self.absent[pair.key] = whys[0] if whys else "there is no pose"
            return
        moments = {str(stamp): _cloud(image) for stamp, image in seen.items() if str(stamp) not in self.moments}
        size = len(json.dumps(moments)) if moments else 0
        if self.size + size > most_bytes or not all(stamp_ns in pictured for stamp_ns in stamps_ns):
            self.absent[pair.key] = LEFT_OUT
            return
        self.size += size
        self.moments |= moments
        self.poses[pair.key] = pair.outcome.T_from_to[:3].ravel().round(6).tolist()

    @property
    def lacking(self) -> str:
        """How many pairs have a pose but no clouds, and why; empty where all have."""
        whys = Counter(self.absent.values())
        return " ".join(
            f"No clouds of {n} of {len(self.poses) + whys.total()}: {why}." for why, n in whys.most_common()
        )


def clouds(
    pairs: Iterable[PairRow], album: Album | None, pictured: Container[int], most_bytes: int = PAGE_BYTES
) -> Clouds:
    """The clouds of the pairs that have a pose: of false constraints first, then of right ones, then of refusals.

    Their colours are those of the page's pictures: of a moment that is not ``pictured`` there is no cloud.
    """
    made = Clouds()
    if album is None:
        return made
    for pair in by_interest(pairs):
        if pair.outcome.T_from_to is None or pair.outcome.from_ns == pair.outcome.to_ns:
            continue
        if LEFT_OUT in made.absent.values():
            made.absent[pair.key] = LEFT_OUT
        else:
            made.add_pair(pair, album, pictured, most_bytes)
    return made


def grid_of(shape: tuple[int, ...]) -> int:
    """How many pixels a point of a cloud is from the next, for `MOST_POINTS` at most of a picture (H, W)."""
    step = ceil(sqrt(max(1.0, shape[0] * shape[1] / MOST_POINTS)))
    while -(-shape[0] // step) * -(-shape[1] // step) > MOST_POINTS:
        step += 1
    return step


def _lacking(seen: DepthImage | None, why: str) -> str:
    """Why a keyframe has no cloud; empty where it has one."""
    if seen is None:
        return why
    return "" if (seen.depth > 0).any() else "no depth was measured"


def _cloud(seen: DepthImage) -> dict[str, Any]:
    """The depth on a grid of pixels, row by row in uint16 of ``unit`` m, 0 where none was measured, with its camera.

    ``grid`` is what a point is from the next, in pixels, and the width and the height of the picture.
    """
    step = grid_of(seen.depth.shape)
    depth = seen.depth[step // 2 :: step, step // 2 :: step]
    depth = np.where(depth > 0, depth, 0.0)
    unit = max(STEP_M, float(depth.max(initial=0.0)) / MOST)
    camera = seen.intrinsics.scaled(step)
    return {
        "depth": zipped(np.rint(depth / unit).astype("<u2").tobytes()),
        "unit": unit,
        "columns": depth.shape[1],
        "camera": [round(value, 4) for value in (camera.fx, camera.fy, camera.cx, camera.cy)],
        "grid": [step, seen.depth.shape[1], seen.depth.shape[0]],
    }
