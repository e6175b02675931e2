# SPDX-License-Identifier: Apache-2.0
"""Tests of what odometry expects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.geometry import pose, rotation_from_vector
from objreg_ros.keyframes.odometry import TravelledPath
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.propose import prior as prior_module
from objreg_ros.registration.propose.prior import Prior, expect
from registration.samples import keyframe, moved

PARAMS = RegistrarParams(
    odometry_translation_noise=0.03, odometry_drift=0.1, odometry_rotation_noise=1.0, odometry_rotation_drift=0.01
)


TURNED = pose(rotation_from_vector(np.radians([0.0, 90.0, 0.0])), np.array([1.0, 0.0, 0.0]))


def _prior(*x: float, sessions: tuple[int, int] = (0, 0)) -> Prior | None:
    """What is expected of the last of several keyframes along x against the first."""
    way = TravelledPath(moved(x[0]))
    for at in x:
        way.go(moved(at))
    first, last = (keyframe(i, i, session=sessions[i], T_odom_camera=moved(x[-i])) for i in (0, 1))
    return expect(replace(last, travelled=way.travelled, turned=way.turned), first, PARAMS)


def test_the_motion_is_that_of_the_odometry_and_its_uncertainty_grows_with_the_path(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    prior = _prior(0.0, 1.0, 0.5)
    assert prior is not None and np.allclose(prior.T_target_source, moved(0.5))
    assert prior.translation_m == pytest.approx(0.03 + 0.1 * 1.5) and prior.rotation_deg == pytest.approx(1.0)
    assert prior.tight()
    monkeypatch.setattr(prior_module, "TIGHT_TRANSLATION_M", 0.1)
    assert not prior.tight()


def test_keyframes_of_different_sessions_expect_nothing() -> None:
    assert _prior(0.0, 1.0, sessions=(0, 1)) is None


def test_our_own_tracking_is_not_trusted() -> None:
    prior = _prior(0.0, 1.0)
    assert prior is not None and not prior.trusted


def test_what_is_expected_is_as_uncertain_whichever_of_the_two_came_first() -> None:
    earlier = replace(keyframe(1, T_odom_camera=TURNED), travelled=1.0, turned=90.0)
    later = replace(keyframe(2, T_odom_camera=moved(3.0)), travelled=3.5, turned=180.0)
    there, back = expect(later, earlier, PARAMS), expect(earlier, later, PARAMS)
    assert there is not None and back is not None
    np.testing.assert_allclose(there.T_target_source[:3, 3], (0.0, 0.0, 2.0), atol=1e-9)  # ahead of the turned camera
    np.testing.assert_allclose(back.T_target_source[:3, 3], (-2.0, 0.0, 0.0), atol=1e-9)
    for prior in (there, back):
        assert prior.translation_m == pytest.approx(0.03 + 0.1 * 2.5)
        assert prior.rotation_deg == pytest.approx(1.0 + 0.01 * 90.0)


@pytest.mark.parametrize(("source", "target"), [(True, True), (True, False), (False, True)])
def test_odometry_is_trusted_where_it_carried_both_keyframes(source: bool, target: bool) -> None:
    pair = (replace(keyframe(k), by_odometry=tracked) for k, tracked in enumerate((source, target)))
    prior = expect(*pair, PARAMS)
    assert prior is not None and prior.trusted is (source and target)


def test_a_registration_starts_from_what_is_certain_in_place_and_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(prior_module, "TIGHT_TRANSLATION_M", 0.2)
    monkeypatch.setattr(prior_module, "TIGHT_ROTATION_DEG", 6.0)
    sure = Prior(T_target_source=np.eye(4), rotation_deg=6.0, translation_m=0.2, trusted=True)
    assert sure.tight()
    assert not replace(sure, rotation_deg=6.1).tight() and not replace(sure, translation_m=0.21).tight()
