# SPDX-License-Identifier: Apache-2.0
"""Fusion: one keyframe of several frames."""

from __future__ import annotations

import numpy as np
import pytest
from registration.samples import box, cloud, frame, moved, scene_view

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import UNNAMED, PointFlag
from objreg_ros.geometry import inverse, pose, pose_error, rotation_from_vector, transform
from objreg_ros.keyframes import fusion
from objreg_ros.keyframes.frame_window import FrameWindow
from objreg_ros.keyframes.fusion import fuse, fuse_objects, motions_to, reference_index
from objreg_ros.registrar.params import RegistrarParams

PARAMS = RegistrarParams()
GROUPS = PARAMS.label_groups


def test_an_object_seen_from_two_places_is_one_object_with_both_sides() -> None:
    left, right = (
        np.array([[0, 0, 1], [0, 0.05, 1], [0, 0.1, 1]]),
        np.array([[0.06, 0, 1], [0.06, 0.05, 1], [0.06, 0.1, 1]]),
    )
    seen = (frame(0, (cloud("cup", left),)), frame(0.1, (cloud("cup", transform(moved(-0.2), right)),)))
    (item,) = fuse_objects(seen, (np.eye(4), moved(0.2)), GROUPS)
    assert item.sightings == 2 and len(item.cloud) == 6
    assert np.allclose(item.centroid, (0.03, 0.05, 1), atol=1e-6)


def test_two_like_objects_of_one_frame_stay_two() -> None:
    near = (box("cup", (0, 0, 1)), box("cup", (0.12, 0, 1)))
    items = fuse_objects((frame(0, near), frame(0.1, near)), (np.eye(4), np.eye(4)), GROUPS)
    assert [(item.label, item.sightings, item.cloud.instance) for item in items] == [("cup", 2, 1), ("cup", 2, 2)]


def test_the_label_is_that_of_most_sightings() -> None:
    seen = [frame(0.1 * i, (box(name, (0, 0, 1)),)) for i, name in enumerate(("mouse", "cup", "cup"))]
    (item,) = fuse_objects(seen, [np.eye(4)] * 3, GROUPS)
    assert item.label == "cup"


def test_a_sighting_cut_by_the_image_gives_way_to_a_whole_one() -> None:
    whole = box("cup", (0, 0, 1))
    half = cloud("cup", whole.xyz[whole.xyz[:, 0] < 0])
    cut = type(half)(
        **{name: getattr(half, name) for name in ("label", "score", "instance", "xyz", "normals", "rgb", "density")},
        flags=np.full(len(half), PointFlag.CUT_BY_IMAGE, np.uint16),
    )
    (item,) = fuse_objects((frame(0, (cut,)), frame(0.1, (whole,))), [np.eye(4)] * 2, GROUPS)
    assert not item.cloud.has(PointFlag.CUT_BY_IMAGE) and item.sightings == 2


def test_the_reference_is_the_frame_that_shows_most() -> None:
    few, more = frame(0, (box("cup", (0, 0, 1)),)), frame(0.1, (box("cup", (0, 0, 1)), box("book", (0.4, 0, 1))))
    assert reference_index((few, more, more)) == 1


def test_the_keyframe_is_in_the_camera_frame_of_its_reference(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fusion, "CONTEXT_RADIUS_M", 3.0)
    T_first_second = moved(0.1)
    table = (box("cup", (0, 0, 1)), box("book", (0.4, 0, 1)))
    first = frame(0, table[:1])
    second = frame(
        0.1,
        tuple(cloud(o.label, transform(inverse(T_first_second), o.xyz)) for o in table),
        view=scene_view(T_first_second),
    )
    window = FrameWindow(
        frames=(first, second), T_first_frame=(np.eye(4), T_first_second), T_session_first=moved(5.0), session=2
    )
    fused = fuse(window, PARAMS)
    assert fused.stamp_ns == second.stamp_ns and fused.session == 2 and fused.labels == ("cup", "book")
    assert np.allclose(fused.objects[0].centroid, (-0.1, 0, 1), atol=0.01)
    assert np.allclose(fused.T_odom_camera, moved(5.1))
    assert len(fused.context) > 200
    wall = fused.context.xyz[(fused.context.xyz[:, 1] < -0.5) & (fused.context.normals[:, 2] < -0.9)]
    assert np.abs(wall[:, 2] - 2.0).max() < 0.35


def test_the_context_stays_within_its_radius_of_the_objects(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fusion, "CONTEXT_RADIUS_M", 0.5)
    window = FrameWindow(
        frames=(frame(0, (box("cup", (0, 0, 1.8)),)),), T_first_frame=(np.eye(4),), T_session_first=np.eye(4), session=0
    )
    context = fuse(window, PARAMS).context
    assert len(context) > 0 and np.linalg.norm(context.xyz - (0, 0, 1.8), axis=1).max() < 0.56


def test_a_large_object_is_thinned_to_the_points_that_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fusion, "OBJECT_POINTS", 1000)
    many = cloud("chair", np.random.default_rng(0).random((5000, 3)))
    (item,) = fuse_objects((frame(0, (many,)),), (np.eye(4),), GROUPS)
    assert 800 < len(item.cloud) <= 1000 and np.allclose(item.centroid, 0.5, atol=0.03)


def test_an_object_without_points_is_passed_over() -> None:
    nothing = cloud("cup", np.zeros((0, 3)))
    seen = (frame(0, (nothing, box("book", (0.4, 0, 1)))), frame(0.1, (nothing,)))
    assert [item.label for item in fuse_objects(seen, [np.eye(4)] * 2, GROUPS)] == ["book"]


def test_an_object_without_a_name_is_seen_in_more_than_one_of_several_frames() -> None:
    thing, cup = box(UNNAMED, (0, 0, 1)), box("cup", (0.4, 0, 1))
    once = fuse_objects((frame(0, (cup, thing)), frame(0.1, (cup,))), [np.eye(4)] * 2, GROUPS)
    assert [item.label for item in once] == ["cup"] and once[0].cloud.instance == 1
    twice = fuse_objects((frame(0, (cup, thing)), frame(0.1, (thing,))), [np.eye(4)] * 2, GROUPS)
    assert [(item.label, item.sightings) for item in twice] == [("cup", 1), (UNNAMED, 2)]
    (alone,) = fuse_objects((frame(0, (thing,)),), [np.eye(4)], GROUPS)
    assert alone.label == UNNAMED


@pytest.mark.parametrize("names", [(UNNAMED, "cup"), ("cup", UNNAMED)])
def test_what_one_frame_names_is_no_second_object_without_a_name(names: tuple[str, str]) -> None:
    seen = [frame(0.1 * i, (box(name, (0, 0, 1)),)) for i, name in enumerate(names)]
    (item,) = fuse_objects(seen, [np.eye(4)] * 2, GROUPS)
    assert item.label == "cup" and item.sightings == 2


def test_two_names_at_one_place_stay_two_objects_with_one_without_a_name_between() -> None:
    seen = [frame(0.1 * i, (box(name, (0, 0, 1)),)) for i, name in enumerate(("cup", UNNAMED, "book"))]
    items = fuse_objects(seen, [np.eye(4)] * 3, GROUPS)
    assert sorted(item.label for item in items) == ["book", "cup"]


def seen_from(T_first_second: Array, T_odometry: Array, by_odometry: bool = True) -> FrameWindow:
    """Two views of the scene, and what odometry says of the motion between them."""
    things = (box("cup", (0, 0, 1)),)
    frames = (frame(0, things), frame(0.1, things, view=scene_view(T_first_second)))
    motions = (np.eye(4), T_odometry)
    return FrameWindow(
        frames=frames, T_first_frame=motions, T_session_first=np.eye(4), session=0, by_odometry=by_odometry
    )


JITTERED = pose(rotation_from_vector(np.radians([0.0, 4.0, 2.0])), np.array([0.06, -0.03, 0.02]))


def test_where_odometry_shows_another_picture_the_views_say_the_motion() -> None:
    (first, second) = motions_to(seen_from(moved(0.02), JITTERED), 0)
    assert np.array_equal(first, np.eye(4))
    degrees, cm = pose_error(second, moved(0.02))
    assert degrees < 0.5 and cm < 1.0


@pytest.mark.parametrize("by_odometry", [True, False])
def test_where_odometry_shows_the_same_picture_it_says_the_motion(by_odometry: bool) -> None:
    near = moved(0.022)
    assert np.array_equal(motions_to(seen_from(moved(0.02), near, by_odometry), 0)[1], near)


def test_our_own_tracking_is_not_tracked_again() -> None:
    assert np.array_equal(motions_to(seen_from(moved(0.02), JITTERED, by_odometry=False), 0)[1], JITTERED)


def test_where_the_views_agree_nowhere_odometry_says_the_motion() -> None:
    assert np.array_equal(motions_to(seen_from(moved(40.0), JITTERED), 0)[1], JITTERED)
