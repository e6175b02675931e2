# SPDX-License-Identifier: Apache-2.0
"""Odometry: what is expected between two keyframes, and how certain that is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.registrar.odometry import Prior, Way, expect
from objreg_ros.registrar.params import RegistrarParams

from .samples import keyframe, moved

PARAMS = RegistrarParams(odometry_translation_noise=0.03, odometry_drift=0.1, odometry_rotation_noise=1.0)


def _prior(*x: float, sessions: tuple[int, int] = (0, 0)) -> Prior | None:
    """What is expected of the last of several keyframes along x against the first."""
    way = Way(moved(x[0]))
    for at in x:
        way.go(moved(at))
    first, last = (keyframe(i, i, session=sessions[i], T_odom_camera=moved(x[-i])) for i in (0, 1))
    return expect(replace(last, travelled=way.travelled, turned=way.turned), first, PARAMS)


def test_the_motion_is_that_of_the_odometry_and_its_uncertainty_grows_with_the_path() -> None:
    prior = _prior(0.0, 1.0, 0.5)
    assert prior is not None and np.allclose(prior.T_target_source, moved(0.5))
    assert prior.translation_m == pytest.approx(0.03 + 0.1 * 1.5) and prior.rotation_deg == pytest.approx(1.0)
    assert prior.tight(PARAMS) and not prior.tight(PARAMS.replaced(prior_translation=0.1))


def test_keyframes_of_different_sessions_expect_nothing() -> None:
    assert _prior(0.0, 1.0, sessions=(0, 1)) is None


def test_our_own_tracking_is_not_trusted() -> None:
    prior = _prior(0.0, 1.0)
    assert prior is not None and not prior.trusted
