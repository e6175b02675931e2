# SPDX-License-Identifier: Apache-2.0
"""Which loops there were to close, by truth, and how many of them were.

A view is a revisit when an earlier one, ``gap`` before it, truly saw the same surfaces. Their overlap is the share of
measured points that the other view measured too, the smaller of both directions. Its view change is the angle between
it and the earlier view that it overlaps most.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import View
from objreg_ros.geometry import inverse, rotation_angle, transform
from objreg_tools.truth import LOOSE, Truth, within

VIEW_CHANGES = ((0, 30), (30, 60), (60, 120), (120, 181))  # degrees, half open
STEP = 4  # every so many pixels of a view are looked at
DEPTH_TOLERANCE = 0.05  # m, and as much again for every 2 m of depth


@dataclass(frozen=True, slots=True, eq=False)
class SeenPlace:
    """What was seen at one time, and from which true pose."""

    stamp_ns: int
    view: View
    T_world_camera: Array


@dataclass(frozen=True, slots=True)
class Revisit:
    """A view that saw again what an earlier one had seen."""

    from_ns: int
    to_ns: int
    view_change_deg: float
    overlap: float


def overlap(a: SeenPlace, b: SeenPlace) -> float:
    """The share 0..1 of the points of one view that the other measured too, the smaller of both directions."""
    return min(_share(a, b), _share(b, a))


def revisits(moments: Sequence[SeenPlace], gap_ns: int, least: float = 0.25) -> list[Revisit]:
    """Every view (in time order) with an earlier one, at least ``gap_ns`` before, that it overlaps by ``least``."""
    found = []
    for k, later in enumerate(moments):
        earlier = [m for m in moments[:k] if later.stamp_ns - m.stamp_ns >= gap_ns]
        if (revisit := revisit_of(later, earlier, least)) is not None:
            found.append(revisit)
    return found


def revisit_of(later: SeenPlace, earlier: Iterable[SeenPlace], least: float = 0.25) -> Revisit | None:
    """The revisit of the earlier view that the later one overlaps most; None if none by ``least``."""
    best, partner = max(((overlap(m, later), m) for m in earlier), key=lambda item: item[0], default=(0.0, later))
    if best < least:
        return None
    turn = rotation_angle(partner.T_world_camera[:3, :3].T @ later.T_world_camera[:3, :3])
    return Revisit(partner.stamp_ns, later.stamp_ns, float(np.degrees(turn)), best)


def closed(revisit: Revisit, closures: Iterable[LoopClosure], truth: Truth, tolerance_ns: int) -> bool:
    """Whether a true closure (5 degrees, 10 cm) ends within ``tolerance_ns`` of the revisit."""
    ending = (c for c in closures if abs(max(c.from_ns, c.to_ns) - revisit.to_ns) <= tolerance_ns)
    return any((error := truth.error(closure)) is not None and within(error, LOOSE) for closure in ending)


def recall_by_view_change(
    found: Sequence[Revisit], closures: Sequence[LoopClosure], truth: Truth, tolerance_ns: int
) -> dict[str, tuple[int, int]]:
    """View change in degrees → (closed, of how many), and ``all``."""
    verdicts = [(revisit, closed(revisit, closures, truth, tolerance_ns)) for revisit in found]
    bins = {f"{low}-{min(high, 180)}": (low, high) for low, high in VIEW_CHANGES}
    counts = {
        name: [good for revisit, good in verdicts if low <= revisit.view_change_deg < high]
        for name, (low, high) in {**bins, "all": (0, 181)}.items()
    }
    return {name: (sum(goods), len(goods)) for name, goods in counts.items()}


def _share(a: SeenPlace, b: SeenPlace) -> float:
    """The share of the points of a that b measured too."""
    xyz = a.view.xyz[::STEP, ::STEP].reshape(-1, 3)
    xyz = xyz[np.isfinite(xyz[:, 2])]
    if len(xyz) == 0:
        return 0.0
    points = transform(inverse(b.T_world_camera) @ a.T_world_camera, xyz.astype(np.float64))
    ahead = points[points[:, 2] > 0.1]
    camera = b.view.intrinsics
    u = np.rint(camera.fx * ahead[:, 0] / ahead[:, 2] + camera.cx).astype(int)
    v = np.rint(camera.fy * ahead[:, 1] / ahead[:, 2] + camera.cy).astype(int)
    inside = (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    z, measured = ahead[inside, 2], b.view.xyz[v[inside], u[inside], 2]
    with np.errstate(invalid="ignore"):
        same = np.abs(z - measured) < DEPTH_TOLERANCE * (1 + z / 2)
    return float(same.sum() / len(xyz))
