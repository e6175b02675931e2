# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.geometry import inverses, pose_error
from objreg_ros.plausibility.camera_fit import MOST_MISFIT, fit_camera
from plausibility.spans import CAMERA, path, spans


def test_a_right_camera_is_found_as_it_says_with_its_motions() -> None:
    T = path(13)
    fit = fit_camera(spans(T), CAMERA)
    assert abs(np.log(fit.focal)) < 3 * fit.focal_sigma < 0.1
    assert (np.abs(fit.centre) < 3 * fit.centre_sigma).all() and fit.count == 12
    for found, true in zip(fit.T_last_first, inverses(T[1:]) @ T[:-1], strict=True):
        degrees, centimetres = pose_error(found, true)
        assert degrees < 0.5 and centimetres < 2.0


@pytest.mark.parametrize("factor", [0.6, 0.9, 1.1, 1.5])
def test_a_focal_length_that_is_stated_wrong_is_measured(factor: float) -> None:
    stated = replace(CAMERA, fx=factor * CAMERA.fx, fy=factor * CAMERA.fy)
    fit = fit_camera(spans(path(13, seed=1)), stated)
    assert abs(np.log(fit.focal * factor)) < 3 * fit.focal_sigma and fit.focal_sigma < 0.05


def test_a_principal_point_that_is_stated_wrong_is_measured() -> None:
    stated = replace(CAMERA, cx=CAMERA.cx - 16.0, cy=CAMERA.cy + 12.0)
    fit = fit_camera(spans(path(13, seed=2)), stated)
    off = fit.centre - np.array([16.0, -12.0]) / CAMERA.width
    assert (np.abs(off) < 3 * fit.centre_sigma).all() and (fit.centre_sigma < 0.05).all()


def test_corners_with_the_depth_of_another_camera_fit_no_motion() -> None:
    rng = np.random.default_rng(3)
    others = [span._replace(z_first=rng.uniform(1, 3, 60), z_last=rng.uniform(1, 3, 60)) for span in spans(path(9))]
    assert np.mean(fit_camera(others, CAMERA).misfit > MOST_MISFIT) > 0.9


def test_a_camera_that_only_shifts_sideways_by_little_says_little_of_its_focal_length() -> None:
    still = fit_camera(spans(path(5, turn_deg=0.1, shift_m=0.02)), CAMERA)
    assert still.focal_sigma > 3 * fit_camera(spans(path(5)), CAMERA).focal_sigma


def test_a_fit_of_no_spans_is_refused() -> None:
    with pytest.raises(ValueError, match="got none"):
        fit_camera([], CAMERA)
