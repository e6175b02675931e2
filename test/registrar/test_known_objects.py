# SPDX-License-Identifier: Apache-2.0
"""Where the objects of a label are, in the session that goes on."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest
from registration.samples import SECOND, box, frame, moved

from objreg_ros.data.closures import Relocalised
from objreg_ros.geometry import inverse, pose, rotation_from_vector, transform
from objreg_ros.memory.landmarks import Landmark
from objreg_ros.memory.sighting import Sighting
from objreg_ros.registrar.known_objects import objects_called
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.registrar import Registrar

T_MAP_ODOM = pose(rotation_from_vector(np.array([0.0, 0.0, np.pi / 2])), np.array([5.0, 0.0, 0.0]))
TURN_SIGMA = 0.1
RELOCALISED = Relocalised(
    stamp_ns=9,
    session=1,
    target_ns=3,
    T_map_odom=T_MAP_ODOM,
    T_map_camera=T_MAP_ODOM,
    covariance=np.diag([0.0, 0.0, 0.0, 0.0, 0.0, TURN_SIGMA**2]),
    closures=2,
)
SEEN = {1: (2, "chair", (1.0, 0.0, 0.0)), 2: (1, "Chair", (7.0, 0.0, 0.0)), 3: (0, "chair", (0.0, 0.0, 0.0))}
LANDMARKS = [
    Landmark(landmark=n, label=label, position=np.array(at), session=session, stamp_ns=n, sightings=2)
    for n, (session, label, at) in SEEN.items()
]


def sightings_of(number: int) -> Iterable[Sighting]:
    """Two of the session that saw it last, 2 cm apart, and one of an earlier session, whose frame is another."""
    session, label, at = SEEN[number]
    for k, (where, shift) in enumerate(((session - 5, 40.0), (session, -0.01), (session, 0.01))):
        yield Sighting(
            keyframe_id=k,
            session=where,
            stamp_ns=k,
            instance=1,
            label=label,
            score=1.0,
            extent=1.0,
            descriptor=np.zeros(1),
            position=np.array(at) + shift * np.array([1.0, 0.0, 0.0]),
            camera=np.zeros(3),
            landmark=number,
        )


def test_an_object_of_this_session_is_where_its_sightings_are() -> None:
    found = objects_called("CHAIR", LANDMARKS, sightings_of, 2, None)
    (chair,) = found.objects
    np.testing.assert_allclose(chair.xyz, (1.0, 0.0, 0.0))
    assert chair.landmark.landmark == 1 and chair.extent == 1.0
    assert found.message == "1 here, 2 in sessions that nothing ties to this one" and found.session == 2


def test_an_object_of_the_map_that_the_camera_is_in_is_brought_here_less_sure_the_farther_away_it_is() -> None:
    found = objects_called("chair", LANDMARKS, sightings_of, 2, RELOCALISED)
    assert [item.landmark.landmark for item in found.objects] == [2, 1]
    chair = found.objects[0]
    np.testing.assert_allclose(chair.xyz, transform(inverse(T_MAP_ODOM), np.array([7.0, 0.0, 0.0])), atol=1e-12)
    alone = objects_called("chair", LANDMARKS, sightings_of, 1, None).objects[0].covariance
    across, along = chair.covariance[0, 0] - alone[1, 1], chair.covariance[1, 1] - alone[0, 0]
    assert across == pytest.approx((2.0 * TURN_SIGMA) ** 2) and along == pytest.approx(0.0, abs=1e-12)


def test_an_object_whose_sightings_of_its_session_are_forgotten_is_where_it_was_seen_last() -> None:
    earlier = lambda number: [one for one in sightings_of(number) if one.session != SEEN[number][0]]  # noqa: E731
    chairs = objects_called("chair", LANDMARKS, earlier, 2, RELOCALISED).objects
    np.testing.assert_allclose(chairs[1].xyz, (1.0, 0.0, 0.0))
    np.testing.assert_allclose(chairs[0].xyz, transform(inverse(T_MAP_ODOM), np.array([7.0, 0.0, 0.0])), atol=1e-12)
    assert [item.extent for item in chairs] == [1.0, 1.0]


def test_a_label_that_is_not_there_is_answered_with_those_that_are() -> None:
    found = objects_called("sofa", LANDMARKS, sightings_of, 2, None)
    assert not found.objects and found.message == "no sofa is known; there are: chair (2), Chair (1)"
    nothing = objects_called("", [], sightings_of, None, None)
    assert nothing.message == "no object is known; there are: no objects yet" and nothing.session is None


def test_a_registrar_knows_where_what_it_saw_is() -> None:
    registrar = Registrar(RegistrarParams())
    try:
        assert not registrar.where("cup").objects
        registrar.process(frame(0.0, (box("cup", (0.3, 0.0, 1.0)),), moved(2.0)))
        registrar.finish()
        found = registrar.where("cup")
        assert registrar.where("").objects[0].landmark.stamp_ns == 0 * SECOND
    finally:
        registrar.close()
    (cup,) = found.objects
    np.testing.assert_allclose(cup.xyz, (2.3, 0.0, 1.0), atol=0.01)
    assert np.sqrt(cup.covariance[0, 0]) < 0.1 and found.message == "1 here"
