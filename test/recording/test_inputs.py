# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

from objreg_ros.segmenter.params import SegmenterNodeParams
from objreg_tools.recording.inputs import SOURCES, choose_inputs, parse_remaps
from objreg_tools.recording.record import Topic

IMAGE, INFO = "sensor_msgs/msg/Image", "sensor_msgs/msg/CameraInfo"
KINDS = {
    "info": INFO,
    "points": "sensor_msgs/msg/PointCloud2",
    "odom": "nav_msgs/msg/Odometry",
    "imu": "sensor_msgs/msg/Imu",
    "pose": "geometry_msgs/msg/PoseStamped",
    "transform": "geometry_msgs/msg/TransformStamped",
    "jpeg": "sensor_msgs/msg/CompressedImage",
}


def topics(text: str) -> dict[str, Topic]:
    """``/a /b:info``: an image and a camera_info."""
    named = [part.partition(":") for part in text.split()]
    return {name: Topic(name, KINDS.get(kind, IMAGE), 3) for name, _, kind in named}


NOVA = (
    "/front_stereo_camera/left/image_rect_color /front_stereo_camera/left/camera_info:info "
    "/front_stereo_camera/right/image_rect_color /front_stereo_camera/right/camera_info:info "
    "/back_stereo_camera/left/image_rect_color /back_stereo_camera/left/camera_info:info "
    "/chassis/odom:odom /chassis/imu:imu /front_stereo_imu/imu:imu /front_3d_lidar/lidar_points:points"
)


def spot(robot: str) -> str:
    """The cameras of a Spot with an arm, each with depth as it was measured and as it was registered."""
    cameras = ("back", "frontleft", "frontright", "hand", "left", "right")
    folders = [f"{robot}/{kind}/{name}" for name in cameras for kind in ("camera", "depth", "depth_registered")]
    return " ".join(f"{folder}/image {folder}/camera_info:info" for folder in folders)


DRIVERS = {
    "a RealSense with its IMU on a robot with another": (
        "/camera/color/image_raw /camera/color/camera_info:info /camera/aligned_depth_to_color/image_raw "
        "/camera/aligned_depth_to_color/camera_info:info /camera/imu:imu /camera/gyro/sample:imu "
        "/camera/accel/sample:imu /mavros/imu/data:imu",
        "image=/camera/color/image_raw depth=/camera/aligned_depth_to_color/image_raw "
        "camera_info=/camera/aligned_depth_to_color/camera_info imu=/camera/imu",
    ),
    "a RealSense whose IMU is not united": (
        "/camera/gyro/sample:imu /camera/accel/sample:imu",
        "imu=/camera/accel/sample",
    ),
    "any IMU": ("/gyro_only:imu /phone/motion:imu", "imu=/phone/motion"),
    "ours": (
        "/image /depth/image /camera_info:info /odom:odom /ground_truth:pose /view:points /objects:points",
        "image=/image depth=/depth/image camera_info=/camera_info odom=/odom ground_truth=/ground_truth",
    ),
    "openni with a registered cloud": (
        "/camera/rgb/image_color /camera/rgb/camera_info:info /camera/depth_registered/points:points "
        "/camera/depth/image /camera/depth/camera_info:info /camera/ir/image_raw",
        "image=/camera/rgb/image_color points=/camera/depth_registered/points camera_info=/camera/rgb/camera_info",
    ),
    "openni with registered depth": (
        "/camera/rgb/image_rect_color /camera/rgb/camera_info:info /camera/depth_registered/points:points "
        "/camera/depth_registered/hw_registered/image_rect_raw /camera/depth_registered/camera_info:info",
        "image=/camera/rgb/image_rect_color depth=/camera/depth_registered/hw_registered/image_rect_raw "
        "camera_info=/camera/depth_registered/camera_info",
    ),
    "realsense-viewer": (
        "/device_0/sensor_0/Depth_0/image/data /device_0/sensor_0/Depth_0/info/camera_info:info "
        "/device_0/sensor_0/Infrared_1/image/data /device_0/sensor_1/Color_0/image/data "
        "/device_0/sensor_1/Color_0/info/camera_info:info",
        "image=/device_0/sensor_1/Color_0/image/data depth=/device_0/sensor_0/Depth_0/image/data "
        "camera_info=/device_0/sensor_0/Depth_0/info/camera_info",
    ),
    "capitals": (
        "/Camera/RGB/Image_Raw /Camera/Depth/Image_Raw /Camera/Depth/Camera_Info:info /Camera/IR/Image /Odom:odom",
        "image=/Camera/RGB/Image_Raw depth=/Camera/Depth/Image_Raw camera_info=/Camera/Depth/Camera_Info odom=/Odom",
    ),
    "the TUM benchmark": (
        "/camera/rgb/image_color /camera/rgb/camera_info:info /camera/depth/image /camera/depth/camera_info:info",
        "image=/camera/rgb/image_color depth=/camera/depth/image camera_info=/camera/depth/camera_info",
    ),
    "kinect2_bridge": (
        "/kinect2/hd/image_color /kinect2/qhd/image_color_rect /kinect2/qhd/image_color_rect/compressed:jpeg "
        "/kinect2/qhd/image_depth_rect /kinect2/qhd/camera_info:info /kinect2/hd/camera_info:info",
        "image=/kinect2/qhd/image_color_rect depth=/kinect2/qhd/image_depth_rect camera_info=/kinect2/qhd/camera_info",
    ),
    "Azure Kinect, native geometry": (
        "/rgb/image_raw /rgb/camera_info:info /depth/image_raw /depth/camera_info:info /rgb_to_depth/image_raw "
        "/rgb_to_depth/camera_info:info /points2:points /ir/image_raw",
        "image=/rgb_to_depth/image_raw depth=/depth/image_raw camera_info=/depth/camera_info",
    ),
    "Azure Kinect, colour geometry": (
        "/rgb/image_raw /rgb/camera_info:info /depth_to_rgb/image_raw /depth_to_rgb/camera_info:info",
        "image=/rgb/image_raw depth=/depth_to_rgb/image_raw camera_info=/depth_to_rgb/camera_info",
    ),
    "realsense": (
        "/camera/color/image_raw /camera/color/camera_info:info /camera/aligned_depth_to_color/image_raw "
        "/camera/depth/image_rect_raw /camera/infra1/image_rect_raw /camera/odom/sample:odom",
        "image=/camera/color/image_raw depth=/camera/aligned_depth_to_color/image_raw "
        "camera_info=/camera/color/camera_info odom=/camera/odom/sample",
    ),
    "only compressed colour": (
        "/camera/rgb/image_raw/compressed:jpeg /camera/depth_registered/points:points",
        "image=/camera/rgb/image_raw/compressed points=/camera/depth_registered/points",
    ),
    "OAK-D": (
        "/oak/rgb/image_raw /oak/rgb/camera_info:info /oak/stereo/image_raw /oak/stereo/image_raw/compressed:jpeg "
        "/oak/stereo/camera_info:info /oak/left/image_raw /oak/right/image_raw",
        "image=/oak/rgb/image_raw depth=/oak/stereo/image_raw camera_info=/oak/stereo/camera_info",
    ),
    "OAK-D with a cloud": (
        "/oak/rgb/image_raw /oak/rgb/camera_info:info /oak/stereo/image_raw /oak/stereo/camera_info:info "
        "/oak/points:points",
        "image=/oak/rgb/image_raw points=/oak/points camera_info=/oak/rgb/camera_info",
    ),
    "only compressed, by every transport": (
        "/camera/color/image_raw/compressed:jpeg /camera/color/camera_info:info "
        "/camera/aligned_depth_to_color/image_raw/compressed:jpeg "
        "/camera/aligned_depth_to_color/image_raw/compressedDepth:jpeg",
        "image=/camera/color/image_raw/compressed camera_info=/camera/color/camera_info "
        "depth=/camera/aligned_depth_to_color/image_raw/compressedDepth",
    ),
    "depth that only its transport gives away": (
        "/cam0/image_raw /cam1/image_raw /cam2/image_raw /cam2/frame/compressedDepth:jpeg /camera_info:info",
        "image=/cam2/image_raw depth=/cam2/frame/compressedDepth camera_info=/camera_info",
    ),
    "a camera called depth": (
        "/depth_cam/rgb/image_raw /depth_cam/rgb/image_raw/compressed:jpeg /depth_cam/rgb/camera_info:info "
        "/depth_cam/depth/image_raw /depth_cam/depth/camera_info:info /depth_cam/depth/points:points",
        "image=/depth_cam/rgb/image_raw points=/depth_cam/depth/points camera_info=/depth_cam/rgb/camera_info",
    ),
    "a camera on the right arm": (
        "/right_arm/camera/color/image_raw /right_arm/camera/color/camera_info:info "
        "/right_arm/camera/aligned_depth_to_color/image_raw /right_arm/camera/aligned_depth_to_color/camera_info:info",
        "image=/right_arm/camera/color/image_raw depth=/right_arm/camera/aligned_depth_to_color/image_raw "
        "camera_info=/right_arm/camera/aligned_depth_to_color/camera_info",
    ),
    "the preview of an OAK-D": (
        "/oakd/rgb/preview/image_raw /oakd/rgb/preview/camera_info:info /oakd/stereo/image_raw "
        "/oakd/stereo/camera_info:info",
        "image=/oakd/rgb/preview/image_raw depth=/oakd/stereo/image_raw camera_info=/oakd/stereo/camera_info",
    ),
    "ZED": (
        "/zed/zed_node/left/color/rect/image /zed/zed_node/right/color/rect/image /zed/zed_node/rgb/color/rect/image "
        "/zed/zed_node/rgb/color/rect/camera_info:info /zed/zed_node/depth/depth_registered "
        "/zed/zed_node/depth/camera_info:info /zed/zed_node/left_raw/image_raw_color",
        "image=/zed/zed_node/rgb/color/rect/image depth=/zed/zed_node/depth/depth_registered "
        "camera_info=/zed/zed_node/depth/camera_info",
    ),
    "a MultiSense, whose depth is that of its left lens": (
        "/multisense/left/image_rect_color /multisense/left/camera_info:info /multisense/right/image_rect "
        "/multisense/right/camera_info:info /multisense/depth",
        "image=/multisense/left/image_rect_color depth=/multisense/depth camera_info=/multisense/left/camera_info",
    ),
    "stereo_image_proc": (
        "/stereo/left/image_rect_color /stereo/left/camera_info:info /stereo/right/image_rect_color "
        "/stereo/right/camera_info:info /stereo/disparity /stereo/points2:points",
        "image=/stereo/left/image_rect_color points=/stereo/points2 camera_info=/stereo/left/camera_info",
    ),
    "stereo matched by Isaac ROS without a namespace": (
        "/left/image_rect /left/camera_info_rect:info /right/image_rect /right/camera_info_rect:info /depth",
        "image=/left/image_rect depth=/depth camera_info=/left/camera_info_rect",
    ),
    "Nova with the depth of a lens": (
        f"{NOVA} /front_stereo_camera/left/depth",
        "image=/front_stereo_camera/left/image_rect_color depth=/front_stereo_camera/left/depth "
        "camera_info=/front_stereo_camera/left/camera_info odom=/chassis/odom imu=/chassis/imu",
    ),
    "Nova with the depth of a camera": (
        f"{NOVA} /front_stereo_camera/depth",
        "image=/front_stereo_camera/left/image_rect_color depth=/front_stereo_camera/depth "
        "camera_info=/front_stereo_camera/left/camera_info odom=/chassis/odom imu=/chassis/imu",
    ),
    "Nova in Isaac Sim": (
        f"{NOVA} /front_stereo_camera/depth/ground_truth /front_stereo_camera/depth/camera_info:info",
        "image=/front_stereo_camera/left/image_rect_color depth=/front_stereo_camera/depth/ground_truth "
        "camera_info=/front_stereo_camera/depth/camera_info odom=/chassis/odom imu=/chassis/imu",
    ),
    "Isaac Sim": (
        "/rgb /depth /camera_info:info /depth_pcl:points /instance_segmentation /semantic_segmentation /normals "
        "/odom:odom",
        "image=/rgb depth=/depth camera_info=/camera_info odom=/odom",
    ),
    "Isaac Sim with two robots": (
        "/robot1/front_cam/rgb /robot1/front_cam/depth /robot1/front_cam/camera_info:info /robot1/odom:odom "
        "/robot2/front_cam/rgb /robot2/front_cam/depth /robot2/front_cam/camera_info:info /robot2/odom:odom",
        "image=/robot1/front_cam/rgb depth=/robot1/front_cam/depth camera_info=/robot1/front_cam/camera_info "
        "odom=/robot1/odom",
    ),
    "Spot": (
        f"{spot('/spot')} /spot/odometry:odom /spot/odometry/corrected:odom",
        "image=/spot/camera/frontleft/image depth=/spot/depth_registered/frontleft/image "
        "camera_info=/spot/depth_registered/frontleft/camera_info odom=/spot/odometry",
    ),
    "Spot without a name": (
        f"{spot('')} /odometry:odom /camera/frontmiddle_virtual/image",
        "image=/camera/frontleft/image depth=/depth_registered/frontleft/image "
        "camera_info=/depth_registered/frontleft/camera_info odom=/odometry",
    ),
    "the hand of Spot": (
        "/camera/hand/image /camera/hand/camera_info:info /depth_registered/hand/image",
        "image=/camera/hand/image depth=/depth_registered/hand/image camera_info=/camera/hand/camera_info",
    ),
    "truth as odometry": (
        "/odometry/filtered:odom /vicon/camera:odom",
        "odom=/odometry/filtered ground_truth=/vicon/camera",
    ),
    "a cloud alone": ("/camera/depth_registered/points:points", "points=/camera/depth_registered/points"),
}


@pytest.mark.parametrize("driver", DRIVERS)
def test_the_topics_of_a_driver_are_recognised(driver: str) -> None:
    there, expected = DRIVERS[driver]
    chosen = {name: topic for name, topic in choose_inputs(topics(there)).chosen().items() if name != "colour_info"}
    assert chosen == dict(pair.split("=") for pair in expected.split())


@pytest.mark.parametrize(
    ("driver", "colour_info"),
    [
        ("OAK-D", "/oak/rgb/camera_info"),
        ("Azure Kinect, native geometry", "/rgb_to_depth/camera_info"),
        ("realsense-viewer", "/device_0/sensor_1/Color_0/info/camera_info"),
        ("ours", None),
        ("kinect2_bridge", None),
        ("OAK-D with a cloud", None),
        ("a camera called depth", None),
    ],
)
def test_colour_has_a_camera_info_of_its_own_only_beside_a_depth_image_with_another(
    driver: str, colour_info: str | None
) -> None:
    assert choose_inputs(topics(DRIVERS[driver][0])).colour_info == colour_info


OWN = (
    "/detections_table:points /objects:points /view:points /view/camera_info:info /landmarks:points /constraints:odom "
    "/gt/transforms:transform /gt/correction:transform"
)


@pytest.mark.parametrize("namespace", ["", "/robot"])
def test_what_the_nodes_published_is_no_input_of_theirs(namespace: str) -> None:
    own = OWN.replace(" /", f" {namespace}/").replace("/detections_table", f"{namespace}/detections_table", 1)
    assert choose_inputs(topics(own)).chosen() == {}
    assert choose_inputs(topics(f"/image /depth/image /camera_info:info {own}")).chosen() == {
        "image": "/image",
        "depth": "/depth/image",
        "camera_info": "/camera_info",
    }


def test_a_remap_may_name_what_the_nodes_published() -> None:
    assert choose_inputs(topics("/constraints:odom"), {"odom": "/constraints"}).odom == "/constraints"


def test_of_two_infos_that_fit_equally_the_shorter_name_wins() -> None:
    there = topics("/image /depth/image /camera_info:info /zed/camera_info:info")
    assert choose_inputs(there).camera_info == "/camera_info"


def test_of_several_infos_in_other_folders_none_is_taken_for_the_cameras() -> None:
    there = topics("/head/image /head/depth/image /arm/camera_info:info /gripper/camera_info:info")
    assert choose_inputs(there).camera_info is None
    assert choose_inputs({name: there[name] for name in list(there)[:3]}).camera_info == "/arm/camera_info"


def test_a_remap_wins_over_everything() -> None:
    there = topics("/image /other /depth/image /camera_info:info /points:points")
    assert choose_inputs(there, {"image": "/other"}).image == "/other"
    inputs = choose_inputs(there, {"points": "/points"})
    assert (inputs.points, inputs.depth) == ("/points", None)


def test_the_left_lens_is_not_taken_for_depth_that_is_measured_elsewhere() -> None:
    there = topics("/cam/left/image_rect /cam/left/camera_info:info /cam/right/image_rect /cam/depth")
    left, tof = "cam_left_optical_frame", "cam_tof_optical_frame"
    assert choose_inputs(there, frames={"/cam/left/image_rect": left, "/cam/depth": left}).complete
    assert choose_inputs(there, frames={"/cam/left/image_rect": left, "/cam/depth": tof}).image is None
    oak = topics("/oak/left/image_raw /oak/left/camera_info:info /oak/stereo/image_raw /oak/stereo/camera_info:info")
    assert choose_inputs(oak).image is None


def test_depth_beside_colour_and_their_only_camera_info_goes_before_points() -> None:
    there = topics("/cam/rgb /cam/depth /cam/camera_info:info /cam/points:points")
    assert choose_inputs(there).depth == "/cam/depth"
    apart = {"/cam/rgb": "cam_rgb_optical_frame", "/cam/depth": "cam_depth_optical_frame"}
    assert choose_inputs(there, frames=apart).points == "/cam/points"


@pytest.mark.parametrize("name", ["/semantic_segmentation", "/cam/instance_segmentation", "/cam/normals", "/segments"])
def test_what_was_made_of_a_picture_is_no_colour(name: str) -> None:
    assert choose_inputs(topics(f"{name} /depth /camera_info:info")).image is None


@pytest.mark.parametrize("driver", DRIVERS)
def test_a_choice_that_is_said_outright_is_made_again(driver: str) -> None:
    there = topics(DRIVERS[driver][0])
    chosen = choose_inputs(there)
    assert choose_inputs(there, chosen.outright) == chosen
    assert choose_inputs({name: there[name] for name in chosen.chosen().values()}, chosen.outright) == chosen


def test_the_segmenters_source_decides_between_points_and_depth() -> None:
    there = topics("/image /depth/image /camera_info:info /points:points")
    assert choose_inputs(there, source="auto").depth == choose_inputs(there, source="depth").depth == "/depth/image"
    inputs = choose_inputs(there, source="points")
    assert (inputs.points, inputs.depth) == ("/points", None)
    lacking = choose_inputs(topics("/image /depth/image"), source="points")
    assert lacking.wanted("points") == "points or a depth image for segmenter.source=points"


def test_a_remap_to_the_depth_that_the_segmenter_leaves_out_is_refused() -> None:
    with pytest.raises(ValueError, match=r"expected no depth with segmenter\.source=points, got /depth/image"):
        choose_inputs(topics("/image /depth/image"), {"depth/image": "/depth/image"}, "points")


def test_the_sources_are_those_of_the_segmenter() -> None:
    declared = next(d for d in SegmenterNodeParams.declarations() if d.name == "source")
    assert declared.choices == SOURCES


def test_an_input_can_be_left_out() -> None:
    inputs = choose_inputs(topics("/image /depth/image /camera_info:info /odom:odom"), {"odom": ""})
    assert inputs.odom is None and inputs.complete


@pytest.mark.parametrize(
    "there",
    [
        "/camera/image_raw /camera/camera_info:info",
        "/camera/color/image_raw /camera/color/camera_info:info /usb_cam/image_raw /usb_cam/image_raw/compressed:jpeg",
        "/stereo/left/image_raw /stereo/right/image_raw /cam0/image_raw /camera_info:info",
        "/rgb_to_depth/image_raw /rgb/image_raw /rgb/camera_info:info",
        "/depth_cam/rgb/image_raw /depth_cam/rgb/image_raw/compressed:jpeg /depth_cam/rgb/camera_info:info",
        "/feed /camera_info:info",
    ],
)
def test_a_picture_that_nothing_says_to_be_depth_is_none(there: str) -> None:
    inputs = choose_inputs(topics(there))
    assert inputs.image is not None and inputs.depth is None
    assert inputs.missing == "points or a depth image"


def test_colour_is_not_left_for_a_topic_whose_name_is_longer_by_depth() -> None:
    assert choose_inputs(topics("/image /imageDepth /camera_info:info")).image == "/image"


def test_a_lone_depth_image_is_not_taken_for_colour() -> None:
    for depth in ("/oak/stereo/image_raw", "/oak/stereo/image_raw/compressedDepth", "/cam2/image_raw/compressedDepth"):
        inputs = choose_inputs(topics(f"{depth} /camera_info:info"))
        assert (inputs.image, inputs.depth) == (None, depth)


@pytest.mark.parametrize(
    "name",
    [
        "/zed/left/color/rect/image",
        "/zed/right_raw/image_raw_color",
        "/cam/image_left",
        "/camera/rgb/depth/image",
        "/depth_cam/depth/image_raw",
        "/front_left_camera/depth/image_rect_raw",
        "/detector/view",
    ],
)
def test_half_of_a_stereo_camera_depth_and_views_are_no_colour(name: str) -> None:
    assert choose_inputs(topics(name)).image is None


def test_an_empty_topic_is_no_input() -> None:
    assert choose_inputs({"/image": Topic("/image", IMAGE, 0)}).image is None


def test_what_is_missing_is_said() -> None:
    assert choose_inputs(topics("/odom:odom")).missing == "a colour image and points or a depth image"
    assert (
        choose_inputs(topics("/image /depth/image")).missing
        == "the camera_info of the depth image (or --camera fx,fy,cx,cy)"
    )
    assert choose_inputs(topics("/image /points:points")).missing == ""


def test_remaps_are_written_as_in_ros() -> None:
    texts = ("image:=/a", "/depth/image:=/b", "odom:=")
    assert parse_remaps(texts) == {"image": "/a", "depth": "/b", "odom": ""}


@pytest.mark.parametrize("text", ["image=/a", ":=/a", "lidar:=/a"])
def test_a_remap_of_another_form_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="remap: expected"):
        parse_remaps([text])


def test_a_remap_to_nowhere_is_refused() -> None:
    with pytest.raises(ValueError, match=r"expected a topic of the recording \(/image\), got /nowhere"):
        choose_inputs(topics("/image"), {"image": "/nowhere"})


@pytest.mark.parametrize(
    ("name", "topic", "expected"),
    [
        ("odom", "/image", r"odom of type geometry_msgs/msg/PoseStamped or nav_msgs/msg/Odometry or .*, got /image \("),
        ("camera_info", "/odom", r"camera_info of type sensor_msgs/msg/CameraInfo, got /odom \(nav_msgs"),
        ("image", "/points", r"image of type sensor_msgs/msg/Image or sensor_msgs/msg/CompressedImage, got /points"),
        ("points", "/image", r"points of type sensor_msgs/msg/PointCloud2, got /image"),
    ],
)
def test_a_remap_to_a_topic_of_another_type_is_refused(name: str, topic: str, expected: str) -> None:
    with pytest.raises(ValueError, match=f"^expected {expected}"):
        choose_inputs(topics("/image /points:points /odom:odom /camera_info:info"), {name: topic})


def test_a_topic_for_two_inputs_is_refused() -> None:
    with pytest.raises(ValueError, match="expected a topic of its own for depth, got /image of image again"):
        choose_inputs(topics("/image /depth/image"), {"image": "/image", "depth": "/image"})


def test_a_topic_that_a_remap_names_is_not_chosen_for_another_input() -> None:
    inputs = choose_inputs(topics("/image /vicon/camera:odom"), {"odom": "/vicon/camera"})
    assert (inputs.odom, inputs.ground_truth) == ("/vicon/camera", None)
