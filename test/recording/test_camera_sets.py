# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from objreg_tools.recording.inputs import alternatives, choose_inputs, depth_of_others

from .test_inputs import topics

FRONT = "/front/rgb/image_raw /front/rgb/camera_info:info /front/depth_registered/image_raw"
BACK = "/back/rgb/image_raw /back/rgb/camera_info:info /back/depth_registered/image_raw"


def test_colour_and_depth_are_those_of_one_camera_in_any_order() -> None:
    for text in (f"{FRONT} {BACK}", f"{BACK} {FRONT}"):
        inputs = choose_inputs(topics(text))
        assert (inputs.image, inputs.depth) == ("/front/rgb/image_raw", "/front/depth_registered/image_raw")
        assert inputs.camera_info == "/front/rgb/camera_info"


def test_the_other_camera_is_an_alternative_with_the_remaps_that_take_it() -> None:
    known = topics(f"{FRONT} {BACK}")
    (other,) = alternatives(known)
    assert other.outright_camera == {"image": "/back/rgb/image_raw", "depth/image": "/back/depth_registered/image_raw"}
    assert choose_inputs(known, other.outright_camera).image == "/back/rgb/image_raw"


def test_one_camera_in_several_topics_has_no_alternative() -> None:
    one = "/camera/color/image_raw /camera/color/image_raw/compressed:jpeg /camera/color/camera_info:info"
    depths = "/camera/aligned_depth_to_color/image_raw /camera/depth/points:points"
    assert alternatives(topics(f"{one} {depths}")) == []


def test_a_camera_that_cannot_run_is_no_alternative() -> None:
    assert alternatives(topics(f"{FRONT} /back/rgb/image_raw")) == []


def test_odometry_of_another_robot_than_the_camera_is_not_taken() -> None:
    camera = "/robot1/camera/color/image_raw /robot1/camera/color/camera_info:info"
    depth = "/robot1/camera/aligned_depth_to_color/image_raw"
    inputs = choose_inputs(topics(f"{camera} {depth} /robot2/odom:odom /robot1/odom:odom"))
    assert inputs.odom == "/robot1/odom"
    assert choose_inputs(topics(f"{camera} {depth} /robot2/odom:odom")).odom is None


def test_depth_of_others_is_that_of_which_none_is_of_the_camera_of_colour() -> None:
    known = topics("/front/rgb/image_raw /front/rgb/camera_info:info /back/depth_registered/image_raw")
    inputs = choose_inputs(known)
    assert inputs.image == "/front/rgb/image_raw" and inputs.depth is None
    assert depth_of_others(known, inputs) == ["/back/depth_registered/image_raw"]
    whole = topics(FRONT)
    assert depth_of_others(whole, choose_inputs(whole)) == []
    colour = topics("/front/rgb/image_raw")
    assert depth_of_others(colour, choose_inputs(colour)) == []
