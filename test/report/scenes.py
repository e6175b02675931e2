# SPDX-License-Identifier: Apache-2.0
"""Runs in space for the tests of what viewers get."""

from __future__ import annotations

from functools import cache

import numpy as np

from objreg_ros.data.images import DepthImage, Intrinsics
from objreg_tools.report.exports.run_scene import RunScene, scene_of
from objreg_tools.report.run.run_summary import RunSummary

from .runs import STEP_NS, TRUTH, summary

SEEN = (0, 30, 60)  # frames that have pictures


class FewPictures:
    """An album with a wall at 2 m, seen in a few frames only."""

    def at(self, stamp_ns: int) -> DepthImage | None:
        """The wall, red; None at any other moment."""
        if stamp_ns not in {k * STEP_NS for k in SEEN}:
            return None
        camera = Intrinsics(fx=500.0, fy=500.0, cx=319.5, cy=239.5, width=640, height=480)
        depth = np.full((480, 640), 2.0, np.float32)
        depth[:, :64] = 0.0
        rgb = np.broadcast_to(np.uint8([200, 10, 20]), (480, 640, 3)).copy()
        return DepthImage(depth=depth, rgb=rgb, intrinsics=camera, stamp_ns=stamp_ns)


@cache
def walk(false: bool = True) -> RunScene:
    """The camera that walks a circle twice."""
    return scene_of(RunSummary.of("walk", summary(false), TRUTH), FewPictures())  # type: ignore[arg-type]
