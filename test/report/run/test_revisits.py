# SPDX-License-Identifier: Apache-2.0
"""Which loops there are, in a world that is one wall."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import View
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import inverse, pose, rotation_from_vector
from objreg_tools.report.run.revisits import SeenPlace, closed, overlap, recall_by_view_change, revisit_of, revisits
from objreg_tools.truth import Truth

CAMERA = Intrinsics(fx=150.0, fy=150.0, cx=79.5, cy=59.5, width=160, height=120)
SECOND = 1_000_000_000


def wall(seconds: float, x: float = 0.0, yaw_deg: float = 0.0) -> SeenPlace:
    """What a camera at (x, 0, 0), turned about its y axis, sees of the wall z = 2 m."""
    T = pose(rotation_from_vector(np.array([0.0, np.radians(yaw_deg), 0.0])), np.array([x, 0.0, 0.0]))
    v, u = np.mgrid[:120, :160]
    rays = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones(u.shape)], axis=-1)
    z = 2.0 / (rays @ T[2, :3])
    xyz = np.where(z[..., None] > 0, rays * z[..., None], np.nan).astype(np.float32)
    return SeenPlace(int(seconds * SECOND), View(xyz=xyz, grey=None, intrinsics=CAMERA), T)


def test_a_view_overlaps_itself_wholly_and_its_back_not_at_all() -> None:
    assert overlap(wall(0), wall(1)) == pytest.approx(1.0)
    assert overlap(wall(0), wall(1, x=50.0)) == 0.0


def test_half_a_picture_to_the_side_is_half_an_overlap() -> None:
    width_m = 160 / CAMERA.fx * 2.0
    assert overlap(wall(0), wall(1, x=width_m / 2)) == pytest.approx(0.5, abs=0.03)


@pytest.mark.parametrize(("shift", "share"), [(0.09, 1.0), (0.12, 0.0)])
def test_at_two_metres_a_depth_is_the_same_within_ten_centimetres(shift: float, share: float) -> None:
    seen = wall(0)
    nearer = replace(seen, T_world_camera=pose(np.eye(3), np.array([0.0, 0.0, shift])))
    assert overlap(seen, nearer) == pytest.approx(share, abs=0.15)


def test_a_place_is_revisited_after_the_gap_and_not_before() -> None:
    found = revisits([wall(0), wall(1), wall(3, x=0.1), wall(4, x=9.0)], gap_ns=2 * SECOND)
    assert [r.to_ns // SECOND for r in found] == [3]
    assert found[0].view_change_deg == pytest.approx(0.0, abs=1e-6)


def test_a_revisit_is_of_the_moment_that_overlaps_most_or_of_none() -> None:
    best = revisit_of(wall(5), [wall(0, x=1.0), wall(1, x=0.2), wall(2, x=0.8)])
    assert best is not None and (best.from_ns, best.to_ns) == (SECOND, 5 * SECOND)
    assert revisit_of(wall(5), [wall(0, x=9.0)]) is None and revisit_of(wall(5), []) is None


def closure(a: SeenPlace, b: SeenPlace, off: float = 0.0) -> LoopClosure:
    T = inverse(a.T_world_camera) @ b.T_world_camera
    T[0, 3] += off
    return LoopClosure(from_ns=a.stamp_ns, to_ns=b.stamp_ns, T_from_to=T, covariance=np.eye(6), labels=())


def test_recall_counts_true_closures_by_view_change() -> None:
    seen = [wall(0), wall(3, x=0.2), wall(6, yaw_deg=35), wall(9, x=20.0)]
    truth = Truth((s.stamp_ns, s.T_world_camera) for s in seen)
    found = revisits(seen, gap_ns=2 * SECOND, least=0.2)
    right, wrong = closure(seen[0], seen[1]), closure(seen[0], seen[2], off=0.3)
    recall = recall_by_view_change(found, [right, wrong], truth, SECOND)
    assert recall == {"0-30": (1, 1), "30-60": (0, 1), "60-120": (0, 0), "120-180": (0, 0), "all": (1, 2)}


def test_a_closure_elsewhere_in_time_closes_nothing() -> None:
    seen = [wall(0), wall(3), wall(30)]
    truth = Truth((s.stamp_ns, s.T_world_camera) for s in seen)
    found = revisits(seen, gap_ns=2 * SECOND)
    assert [closed(r, [closure(seen[0], seen[2])], truth, SECOND) for r in found] == [False, True]
