# SPDX-License-Identifier: Apache-2.0
"""What the segmenter makes of its parameters."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.segmenter.params import SegmenterNodeParams, SegmenterParams


def test_the_limits_are_those_that_are_set() -> None:
    assert SegmenterParams(z_max=3.5, y_max=0.9).limits == (0.2, 3.5, 0.9)


def test_preset_paper_has_the_limits_of_the_founding_method_whatever_is_set() -> None:
    assert SegmenterParams(preset="paper", z_max=3.5, y_max=0.9).limits == (0.2, 1.75, 0.75)


def test_where_the_camera_is_mounted_is_a_pose_and_nothing_is_none() -> None:
    T = SegmenterNodeParams(T_base_camera=(0.1, 0.2, 0.3, 0.0, 0.0, 1.0, 0.0)).mounting
    np.testing.assert_allclose(T, [[-1, 0, 0, 0.1], [0, -1, 0, 0.2], [0, 0, 1, 0.3], [0, 0, 0, 1]], atol=1e-12)
    assert SegmenterNodeParams().mounting is None


def test_a_mounting_that_cannot_be_is_refused_when_it_is_set() -> None:
    with pytest.raises(ValueError, match="expected x y z qx qy qz qw or nothing, got"):
        SegmenterNodeParams(T_base_camera=(1.0, 2.0, 3.0))


def test_the_node_s_other_values_are_checked_too() -> None:
    with pytest.raises(ValueError, match="slop: expected at least 0, got -1"):
        SegmenterNodeParams(slop=-1.0)


def test_limits_that_no_depth_can_keep_are_refused() -> None:
    with pytest.raises(ValueError, match=r"z_max: expected more than z_min \(3\), got 1"):
        SegmenterParams(z_min=3.0, z_max=1.0)
    with pytest.raises(ValueError, match="z_max: expected more than z_min"):
        SegmenterParams(z_min=2.0).replaced(z_max=1.5)
