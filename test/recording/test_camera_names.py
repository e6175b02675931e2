# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

from objreg_tools.recording.camera_names import (
    BY_FRAME,
    GENERICALLY_SAME,
    HALF,
    SAME,
    are_twins,
    camera_words,
    relation,
    robot_of,
    share_frame,
)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("/camera/color/image_raw", ("camera",)),
        ("/spot/depth_registered/frontleft/image", ("spot", "frontleft")),
        ("/front/rgb/image_raw/compressed", ("front",)),
        ("/camera/depth/camera_info", ("camera",)),
        ("/image", ()),
    ],
)
def test_what_names_the_camera_is_left_of_the_name_of_its_picture(name: str, words: tuple[str, ...]) -> None:
    assert camera_words(name) == words


@pytest.mark.parametrize(
    ("one", "other", "expected"),
    [
        ("/camera/color/image_raw", "/camera/aligned_depth_to_color/image_raw", SAME),
        ("/camera/rgb/image_raw", "/cam/depth/image_raw", GENERICALLY_SAME),
        ("/zed/left/image_rect_color", "/zed/depth/depth_registered", HALF),
        ("/front/rgb/image_raw", "/back/depth/image_raw", None),
        ("/cam_1/color/image_raw", "/cam_2/depth/image_raw", None),
    ],
)
def test_topics_are_of_one_camera_by_their_names(one: str, other: str, expected: int | None) -> None:
    assert relation(one, other) == relation(other, one) == expected


def test_frames_join_what_names_do_not_and_part_what_names_leave_open() -> None:
    one, other = "/left_eye/image", "/ranges/depth"
    assert relation(one, other) is None
    assert relation(one, other, {one: "optical_frame", other: "optical_frame"}) == BY_FRAME
    colour, depth = "/rgb/image_raw", "/depth/image_raw"
    assert relation(colour, depth, {colour: "front_optical", depth: "front_optical"}) == SAME
    assert relation(colour, depth, {colour: "front_optical", depth: "back_optical"}) is None


def test_whether_two_topics_share_a_frame_is_unknown_without_both_frames() -> None:
    assert share_frame("/a", "/b", {"/a": "x", "/b": "x"}) is True
    assert share_frame("/a", "/b", {"/a": "x", "/b": "y"}) is False
    assert share_frame("/a", "/b", {"/a": "x"}) is None and share_frame("/a", "/b", None) is None


def test_the_first_folder_is_a_robot_unless_it_is_a_camera() -> None:
    assert robot_of("/robot1/camera/image") == "robot1" and robot_of("/camera/image") == "" == robot_of("/odom")


def test_two_robots_differ_by_a_number_or_have_a_topic_of_one_name() -> None:
    assert are_twins("robot1", "robot2", ()) and are_twins("carter_a", "carter_b", ())
    assert are_twins("ann", "bob", ("/ann/odom", "/bob/odom")) and not are_twins("ann", "tools", ("/ann/odom",))
    assert not are_twins("robot1", "robot1", ()) and not are_twins("", "robot1", ())
