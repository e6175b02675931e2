# SPDX-License-Identifier: Apache-2.0
"""The camera is measured by how corners of known depth move."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.geometry import pose_error
from objreg_ros.plausibility.camera_fit import MOST_MISFIT, fit_camera
from objreg_ros.plausibility.corner_tracks import Span
from plausibility.moving import CAMERA, random_motions, seen_spans

MOTIONS = random_motions(16)
SPANS = seen_spans(MOTIONS)


def test_the_right_camera_has_no_offset_and_its_motions_come_back() -> None:
    fit = fit_camera(SPANS, CAMERA)
    assert fit.count == len(SPANS) and fit.misfit.max() < 1.0
    assert abs(np.log(fit.focal)) < 0.01 and np.abs(fit.centre).max() < 0.01
    assert max(fit.focal_sigma, *fit.centre_sigma) < 0.03
    errors = [pose_error(found, true) for found, true in zip(fit.T_last_first, MOTIONS, strict=True)]
    assert np.max(errors, axis=0)[0] < 0.5 and np.max(errors, axis=0)[1] < 2.0


@pytest.mark.parametrize("stated", [0.7, 0.9, 1.1, 1.3])
def test_a_focal_length_that_is_off_is_found_within_its_deviation(stated: float) -> None:
    fit = fit_camera(SPANS, replace(CAMERA, fx=stated * CAMERA.fx, fy=stated * CAMERA.fy))
    assert abs(np.log(fit.focal * stated)) < fit.focal_sigma < 0.03
    assert (np.abs(fit.centre) < fit.centre_sigma).all()


@pytest.mark.parametrize(("right", "down"), [(0.1, 0.0), (0.0, -0.1), (-0.06, 0.08)])
def test_a_principal_point_that_is_off_is_found_within_its_deviation(right: float, down: float) -> None:
    stated = replace(CAMERA, cx=CAMERA.cx - right * CAMERA.width, cy=CAMERA.cy - down * CAMERA.width)
    fit = fit_camera(SPANS, stated)
    assert (np.abs(fit.centre - [right, down]) < fit.centre_sigma).all() and fit.centre_sigma.max() < 0.03
    assert abs(np.log(fit.focal)) < fit.focal_sigma


def test_a_fit_goes_on_from_an_earlier_one_to_the_same_camera() -> None:
    stated = replace(CAMERA, fx=1.3 * CAMERA.fx, fy=1.3 * CAMERA.fy)
    first = fit_camera(SPANS[:6], stated)
    assert fit_camera(SPANS, stated, first).focal == pytest.approx(fit_camera(SPANS, stated).focal, rel=5e-3)


def test_more_spans_leave_less_deviation() -> None:
    noisy = seen_spans(MOTIONS, noise_px=0.5)
    assert fit_camera(noisy, CAMERA).focal_sigma < fit_camera(noisy[:4], CAMERA).focal_sigma


def test_corners_without_any_error_leave_what_depth_and_lens_err_by() -> None:
    fit = fit_camera(seen_spans(MOTIONS, noise_px=0.0), CAMERA)
    assert fit.focal_sigma > 0.01 and (fit.centre_sigma > 0.01).all()


def of_other_depth(spans: list[Span]) -> list[Span]:
    """The same corners with the depths of others, as of a camera that looks elsewhere."""
    return [span._replace(z_first=span.z_first[::-1], z_last=span.z_last[::-1]) for span in spans]


def test_corners_whose_depth_is_of_another_camera_are_misfits() -> None:
    assert np.mean(fit_camera(of_other_depth(SPANS), CAMERA).misfit > MOST_MISFIT) > 0.7


def test_a_few_spans_that_cannot_be_do_not_move_the_camera() -> None:
    back = of_other_depth(seen_spans(random_motions(3, seed=7), seed=7))
    fit = fit_camera([*SPANS, *back], CAMERA)
    assert (fit.misfit > MOST_MISFIT).tolist() == [False] * len(SPANS) + [True] * len(back)
    assert fit.count == len(SPANS) and abs(np.log(fit.focal)) < fit.focal_sigma


def test_a_camera_that_does_not_turn_leaves_its_focal_length_open() -> None:
    resting = random_motions(8, turn=0.0, shift_m=0.0)
    fit = fit_camera(seen_spans(resting), CAMERA)
    assert fit.focal_sigma > 0.2
    assert pose_error(fit.T_last_first[0], np.eye(4))[1] < 1.0


def test_without_spans_there_is_no_camera() -> None:
    with pytest.raises(ValueError, match="expected spans"):
        fit_camera([], CAMERA)
