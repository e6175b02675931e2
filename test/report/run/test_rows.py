# SPDX-License-Identifier: Apache-2.0
"""What a row of a run's JSON is read as."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_tools.report.run.rows import Glimpse, advancing, glimpse_of, read_rows
from report.runs import tracked


def test_a_frame_has_the_pose_of_odometry_or_of_our_own_tracking_or_none() -> None:
    T = np.diag([-1.0, -1.0, 1.0, 1.0])
    by_tracking = Glimpse(5, tracked=(3, T))
    assert by_tracking.pose(by_tracking=False) is None and by_tracking.pose(by_tracking=True) == (3, T)
    assert Glimpse(5, T_odom_camera=T).pose(by_tracking=False) == (0, T)


def test_frames_that_come_late_are_not_tracked() -> None:
    rows = [Glimpse(stamp_ns, tracked=(k, np.eye(4))) for k, stamp_ns in enumerate((1, 3, 2, 3, 4))]
    assert [frame.session for _, frame in advancing([*rows, Glimpse(9)], by_tracking=True)] == [0, 1, 4]
    assert advancing(rows) == []


def test_rows_that_are_not_there_are_none_and_odd_ones_are_named() -> None:
    run = tracked()
    assert len(read_rows("walk", run, "glimpses", glimpse_of)) == len(run["glimpses"])
    assert read_rows("walk", {}, "glimpses", glimpse_of) == ()
    with pytest.raises(ValueError, match="walk: expected glimpses as"):
        read_rows("walk", {"glimpses": [{"stamp_ns": 1, "tracked": {"session": 0}}]}, "glimpses", glimpse_of)


def test_outlines_are_one_an_object_and_corners_only() -> None:
    row = {"stamp_ns": 1, "objects": [["cup", [0.0, 0.0, 1.0]]], "outlines": ["1,2 30,4 5,600"]}
    assert glimpse_of(row).outlines == ("1,2 30,4 5,600",)
    assert glimpse_of({**row, "outlines": []}).outlines == ()
    for bad in (["", ""], ["1,2"], ['1,2 3,4 5,6"/><script>']):
        with pytest.raises(ValueError, match="outlines"):
            glimpse_of({**row, "outlines": bad})
