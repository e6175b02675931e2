# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from typing import Any

import numpy as np

from objreg_ros.data.images import DepthImage, Intrinsics
from objreg_ros.geometry import pose
from objreg_tools.report.run.revisits import Revisit
from objreg_tools.report.sweep.revisits_of_run import closed_of, revisits_in
from objreg_tools.truth import Truth

S = 1_000_000_000
CAMERA = Intrinsics(fx=160.0, fy=160.0, cx=79.5, cy=59.5, width=160, height=120)


class Wall:
    """In an album's stead: a wall 2 m before the camera, whatever the time."""

    def at(self, stamp_ns: int) -> DepthImage:
        depth = np.full((120, 160), 2.0, np.float32)
        return DepthImage(depth=depth, rgb=None, intrinsics=CAMERA, stamp_ns=stamp_ns)


def at(x: float) -> np.ndarray:
    return pose(np.eye(3), np.array([x, 0.0, 0.0]))


def summary(*constraints: tuple[float, float, float], last_s: float = 100.0) -> dict[str, Any]:
    """Constraints from and to, in seconds, each off by so many centimetres."""
    rows = [
        {"from_ns": round(a * S), "to_ns": round(b * S), "error": {"rotation_deg": 0.0, "translation_cm": off}}
        for a, b, off in constraints
    ]
    return {"constraints": rows, "glimpses": [{"stamp_ns": round(last_s * S)}]}


def test_who_goes_along_a_wall_and_comes_back_sees_it_again() -> None:
    stops = [0.0, 1.0, 2.0, 3.0, 4.0, 2.0, 0.0]
    truth = Truth((k * S // 8, at(x)) for k, x in enumerate(np.interp(np.arange(0, 60), np.arange(7) * 10, stops)))
    (first, *_), found = revisits_in(truth, Wall()), revisits_in(truth, Wall())  # type: ignore[arg-type]
    assert all(one.to_ns - one.from_ns >= 2 * S and one.overlap >= 0.25 for one in found)
    assert first.to_ns >= 40 * S // 8, "on the first pass nothing is seen again"
    assert revisits_in(Truth([]), Wall()) == []  # type: ignore[arg-type]


def test_a_revisit_is_closed_by_a_right_constraint_that_ends_near_it() -> None:
    found = [Revisit(0, 50 * S, 0.0, 0.9), Revisit(0, 60 * S, 0.0, 0.9), Revisit(0, 70 * S, 0.0, 0.9)]
    assert closed_of(found, summary((1, 50.5, 3.0), (1, 60, 12.0), (1, 64, 1.0))) == (1, 3)


def test_a_revisit_after_the_last_frame_is_not_asked_for() -> None:
    found = [Revisit(0, 50 * S, 0.0, 0.9), Revisit(0, 60 * S, 0.0, 0.9)]
    assert closed_of(found, summary((50, 1, 0.0), last_s=55.0)) == (1, 1)
    assert closed_of([], summary()) == (0, 0)
