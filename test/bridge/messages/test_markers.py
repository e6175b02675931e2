# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest
from visualization_msgs.msg import Marker

from objreg_ros.bridge.messages.markers import GOLD, WHITE, MarkerScene
from objreg_ros.data.closures import LoopClosure, Reason, Rejected
from objreg_ros.data.frames import Frame, View
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import pose

CAMERA = Intrinsics(fx=1.0, fy=1.0, cx=0.0, cy=0.0, width=2, height=2)


def frame(stamp_ns: int, x: float) -> Frame:
    return Frame(
        objects=(),
        support=None,
        view=View(xyz=np.ones((2, 2, 3), np.float32), grey=None, intrinsics=CAMERA),
        gravity=None,
        gravity_confidence=0.0,
        T_odom_camera=pose(np.eye(3), np.array([x, 0.0, 0.0])),
        stamp_ns=stamp_ns,
    )


def closure(from_ns: int, to_ns: int) -> LoopClosure:
    return LoopClosure(from_ns=from_ns, to_ns=to_ns, T_from_to=np.eye(4), covariance=np.eye(6), labels=())


def ends(scene: MarkerScene, name: str) -> list[float]:
    markers = scene.markers([], 0, "odom").markers
    (lines,) = [marker for marker in markers if marker.ns == name]
    assert lines.type == Marker.LINE_LIST
    return [point.x for point in lines.points]


def test_an_edge_runs_from_where_one_keyframe_was_to_where_the_other_was() -> None:
    scene = MarkerScene()
    for stamp_ns in range(1, 5):
        scene.see(frame(stamp_ns, x=10.0 * stamp_ns))
    scene.show_keyframe(1)
    scene.show_keyframe(2)
    scene.join([], [Rejected(reason=Reason.TEXTURE, from_ns=1, to_ns=2, detail="")])
    scene.show_keyframe(4)
    scene.join([closure(1, 4)], [])
    assert ends(scene, "accepted") == [10.0, 40.0] and ends(scene, "rejected") == [10.0, 20.0]


def test_an_edge_to_a_keyframe_of_unknown_place_is_not_drawn() -> None:
    scene = MarkerScene()
    scene.see(frame(2, x=1.0))
    scene.show_keyframe(2)
    scene.join([closure(1, 2)], [])
    assert ends(scene, "accepted") == []


def test_an_edge_that_comes_after_its_keyframes_is_drawn_and_goes_when_it_is_withdrawn() -> None:
    scene = MarkerScene()
    for stamp_ns in (1, 2):
        scene.see(frame(stamp_ns, x=10.0 * stamp_ns))
        scene.show_keyframe(stamp_ns)
    assert not scene.join([], []) and scene.join([closure(1, 2)], [])
    assert ends(scene, "accepted") == [10.0, 20.0]
    assert not scene.part([closure(1, 3)]) and scene.part([closure(1, 2)])
    assert ends(scene, "accepted") == []


def test_a_long_run_shows_the_newest_edges(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("objreg_ros.bridge.messages.markers.RECENT_CLOSURES", 2)
    scene = MarkerScene()
    for stamp_ns in range(1, 5):
        scene.see(frame(stamp_ns, x=10.0 * stamp_ns))
        scene.show_keyframe(stamp_ns)
        scene.join([closure(1, stamp_ns)] if stamp_ns > 1 else [], [])
    assert ends(scene, "accepted") == [10.0, 30.0, 10.0, 40.0]


def test_objects_are_shown_with_their_names() -> None:
    markers = MarkerScene().markers([(7, "cup", np.array([1.0, 2.0, 3.0]))], 5, "odom").markers
    (name,) = [marker for marker in markers if marker.type == Marker.TEXT_VIEW_FACING]
    assert name.text == "cup 7" and name.header.frame_id == "odom" and name.pose.position.y == 2.0


def test_each_marker_has_the_colour_of_its_kind() -> None:
    for marker in MarkerScene().markers([(7, "cup", np.zeros(3))], 5, "odom").markers:
        expected = {Marker.TEXT_VIEW_FACING: WHITE, Marker.SPHERE: GOLD}.get(marker.type)
        if expected is not None:
            assert (marker.color.r, marker.color.g, marker.color.b, marker.color.a) == pytest.approx(expected)


def test_nothing_is_left_of_a_cleared_scene() -> None:
    scene = MarkerScene()
    for stamp_ns in (1, 2):
        scene.see(frame(stamp_ns, x=1.0))
        scene.show_keyframe(stamp_ns)
        scene.join([closure(1, 2)], [])
    scene.clear()
    assert ends(scene, "accepted") == []


def test_the_places_of_keyframes_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("objreg_ros.bridge.messages.markers.MOST_PLACES", 3)
    scene = MarkerScene()
    for stamp_ns in range(1, 7):
        scene.see(frame(stamp_ns, float(stamp_ns)))
        scene.show_keyframe(stamp_ns)
        scene.join([closure(stamp_ns - 1, stamp_ns)], [])
    assert ends(scene, "accepted") == [4.0, 5.0, 5.0, 6.0]
