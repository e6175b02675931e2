# SPDX-License-Identifier: Apache-2.0
"""Where known objects should be in a camera."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from registration.samples import SECOND, box, keyframe, moved

from objreg_ros.data.closures import Relocalised
from objreg_ros.memory.known import Last, last_of
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.registrar.localisation.places import places_of, shown_by, sigma_of
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.labels import LabelGroups

PARAMS = RegistrarParams()
HERE = keyframe(2, 20.0, (), 5, moved(0.2))
TIED = Relocalised(
    stamp_ns=0, session=3, target_ns=0, T_map_odom=moved(7.0), T_map_camera=moved(7.2), closures=2,
    covariance=np.diag([0.04, 0.01, 0.01, 1.0, 1.0, 1.0]),
)  # fmt: skip


def known(label: str = "mouse", session: int = 5, seconds: float = 10.0) -> Last:
    seen = keyframe(1, seconds, (box(label, (0.0, 0.0, 1.0)),), session)
    return last_of(sightings_of(seen)[0])


def test_an_object_of_the_session_is_where_odometry_has_it_and_less_surely_the_longer_the_path() -> None:
    (place,) = places_of([(4, known(), 2)], replace(HERE, travelled=1.0), None, 0, PARAMS)
    assert np.allclose(place.xyz, [-0.2, 0.0, 1.0], atol=0.01) and (place.landmark, place.group) == (4, "cup")
    assert place.sigma_m == pytest.approx(PARAMS.odometry_translation_noise + PARAMS.odometry_drift)


def test_what_is_expected_of_it_ends_where_odometry_was_found_wrong() -> None:
    assert places_of([(4, known(), 2)], HERE, None, 11 * SECOND, PARAMS) == []


def test_an_object_of_the_tied_map_is_where_the_tie_has_it_and_of_no_other() -> None:
    last = known(session=3)
    assert places_of([(4, last, 2)], HERE, None, 0, PARAMS) == []
    assert places_of([(4, known(session=1), 2)], HERE, TIED, 0, PARAMS) == []
    (place,) = places_of([(4, last, 2)], HERE, TIED, 0, PARAMS)
    assert np.allclose(place.xyz, [-7.2, 0.0, 1.0], atol=0.01)
    assert place.sigma_m == sigma_of(TIED) == pytest.approx(np.sqrt(0.02))


def test_what_one_keyframe_alone_shows_or_has_no_name_is_not_expected() -> None:
    assert places_of([(4, known(), 1), (5, known("thing"), 3)], HERE, None, 0, PARAMS) == []
    seen = keyframe(1, 0.0, (box("thing", (0, 0, 1)), box("mouse", (0, 0, 1))))
    assert [one.group for one in shown_by(seen, LabelGroups(PARAMS.label_groups))] == ["cup"]
