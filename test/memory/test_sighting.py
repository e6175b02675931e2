# SPDX-License-Identifier: Apache-2.0
"""What is kept of an object once its points are gone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from registration.samples import box, keyframe, moved

from objreg_ros.geometry import pose, rotation_from_vector, transform
from objreg_ros.memory.descriptor import describe
from objreg_ros.memory.sighting import sightings_of

QUARTER = rotation_from_vector(np.array([0.0, np.pi / 2, 0.0]))
CUP, BOOK = box("cup", (0.1, 0, 1)), box("book", (0.5, 0.2, 2), side=0.3, instance=2)


def test_each_object_is_sighted_once_and_in_order_with_what_is_known_of_it_and_its_keyframe() -> None:
    seen = replace(keyframe(7, 3.5, (CUP, BOOK), session=4), travelled=2.5, by_odometry=True)
    sightings = sightings_of(seen)
    assert [(one.label, one.instance, one.score) for one in sightings] == [("cup", 1, 0.9), ("book", 2, 0.9)]
    for one, item in zip(sightings, seen.objects, strict=True):
        assert (one.keyframe_id, one.session, one.stamp_ns) == (7, 4, 3_500_000_000)
        assert (one.travelled, one.by_odometry, one.landmark) == (2.5, True, 0)
        assert one.extent == item.extent
        assert np.array_equal(one.descriptor, describe(item.cloud))
        assert np.array_equal(one.R_landmark_session, np.eye(3))


def test_the_middle_of_an_object_and_the_camera_are_in_the_frame_of_the_session() -> None:
    T_session_camera = pose(QUARTER, np.array([1.0, 2.0, 3.0]))
    (cup,) = sightings_of(keyframe(objects=(CUP,), T_odom_camera=T_session_camera))
    assert np.allclose(cup.camera, (1, 2, 3))
    assert np.allclose(cup.position, transform(T_session_camera, np.array([0.1, 0.0, 1.0])), atol=0.005)
    assert np.allclose(cup.position, (2, 2, 2.9), atol=0.005)  # a quarter turn about y: z is x and x is -z


def test_without_a_pose_the_camera_is_where_its_session_begins() -> None:
    (cup,) = sightings_of(replace(keyframe(objects=(CUP,)), T_odom_camera=None))
    assert np.array_equal(cup.camera, np.zeros(3))
    assert np.allclose(cup.position, (0.1, 0, 1), atol=0.005)


def test_a_keyframe_without_objects_sights_none() -> None:
    assert sightings_of(keyframe(objects=())) == ()


def test_a_sighting_outlives_the_pose_that_it_was_made_of() -> None:
    T = moved(1.0)
    (cup,) = sightings_of(keyframe(objects=(CUP,), T_odom_camera=T))
    T[:3, 3] = 9.0
    assert np.allclose(cup.camera, (1, 0, 0)) and np.allclose(cup.position, (1.1, 0, 1), atol=0.005)


def test_a_sighting_of_a_landmark_is_the_same_but_for_that() -> None:
    (cup,) = sightings_of(keyframe(5, objects=(CUP,)))
    known = cup.of_landmark(8, QUARTER)
    assert (known.landmark, cup.landmark) == (8, 0)
    assert np.array_equal(known.R_landmark_session, QUARTER) and np.array_equal(cup.R_landmark_session, np.eye(3))
    assert (known.keyframe_id, known.label) == (5, "cup") and known.position is cup.position


def test_the_same_view_from_two_sessions_has_one_viewpoint() -> None:
    (here,) = sightings_of(keyframe(objects=(CUP,), T_odom_camera=moved(1.0)))
    there = pose(QUARTER.T, np.array([4.0, 0.0, -2.0])) @ moved(1.0)  # the axes of another session, turned
    (again,) = sightings_of(keyframe(objects=(CUP,), T_odom_camera=there))
    assert np.allclose(here.viewpoint, (-0.1, 0, -1), atol=0.005)  # from the cup to the camera
    assert not np.allclose(again.viewpoint, here.viewpoint, atol=0.5)
    assert np.allclose(again.of_landmark(1, QUARTER).viewpoint, here.viewpoint, atol=1e-6)
