# SPDX-License-Identifier: Apache-2.0
"""The inputs that a topic may serve, by its type and by the names that drivers use.

Drivers do not agree on names, so a rule is a ranking: the first pattern that fits wins.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from objreg_tools.recording.record import Topic

PICTURES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
POSES = (
    "geometry_msgs/msg/PoseStamped",
    "nav_msgs/msg/Odometry",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "geometry_msgs/msg/TransformStamped",
)
# What the nodes themselves publish, in any namespace: no input of theirs, unless a remap says so.
OWN = re.compile(r"(^|/)(detections_table|objects|view(/camera_info)?|constraints|transforms|landmarks|correction)$")
TRUTH = r"ground_?truth|(^|/)gt(/|$|_)|vicon|mocap|vrpn|optitrack"


@dataclass(frozen=True, slots=True)
class Rule:
    """What an input may be: its types, names that it never has, and names by preference (regular expressions).

    A topic that fits no preference comes last; where there is ``proof``, it comes only if its name has that.
    """

    types: tuple[str, ...]
    never: str
    prefer: tuple[str, ...]
    proof: str = ""


DEPTH_ENCODING = r"/compressedDepth$"  # a transport that takes nothing but depth
STEREO = r"stereo/image_(raw|rect)(/|$)"  # OAK-D: the depth of its two grey cameras
COLOUR_FOLDER = r"/(rgb|colou?r)(/|$)"
# A part before a folder of colour is a camera's name: /depth_cam/rgb/image_raw, /right_arm/camera/color/image_raw.
IS_KIND = rf"(?!.*{COLOUR_FOLDER})"
HALF_OF_STEREO = rf"(^|/)(left|right)(/|$)|(?<![a-z])(left|right){IS_KIND}"

# The first of two pictures that fit equally is the one of the shorter name: raw before compressed.
RULES = {
    "image": Rule(
        PICTURES,
        rf"(?<!rgb_to_)depth{IS_KIND}|(^|/)ir(/|_|$)|infra|disparity|mask|label|confidence|body_index|(^|/)theora"
        rf"|objects|(^|/)view(/|$)|segment|(^|/)(semantic|instance|panoptic|normals?)[^/]*$|{STEREO}|{DEPTH_ENCODING}",
        (
            r"rgb_to_depth/image",  # Azure Kinect: colour in the geometry of its native depth
            r"^/?image$",
            r"rgb/image_rect_color",
            r"image_color_rect",
            r"rgb/image_color",
            r"rgb/image_raw",
            r"rgb/image",
            r"color/image",
            r"colou?r",
            r"rgb",
            r"image",
        ),
    ),
    "points": Rule(
        ("sensor_msgs/msg/PointCloud2",),
        r"objects|(^|/)view(/|$)|velodyne|lidar|ouster|livox|map",
        (r"^/?points$", r"depth_registered/points", r"hd/points|qhd/points|sd/points", r"points2?$", r"points|cloud"),
    ),
    "depth": Rule(
        PICTURES,
        rf"(^|/)ir(/|_|$)|infra|rgb_to_depth|disparity|confidence|{COLOUR_FOLDER}(?!.*[dD]epth)",
        (
            r"^/?depth/image$",
            r"depth_registered/hw_registered/image_rect",
            r"depth_registered/.*image_rect",
            r"depth_registered(/|$)",
            r"aligned_depth_to_colou?r",
            r"depth_to_rgb/",
            r"(hd|qhd)/image_depth_rect",
            r"rgb.*depth",
            r"depth/image_rect",
            r"depth/image",
            r"depth",
            STEREO,
        ),
        DEPTH_ENCODING,
    ),
    "odom": Rule(("nav_msgs/msg/Odometry",), TRUTH, (r"^/?odom$", r"^(?!.*gps).*odom", r"^(?!.*gps)", r".")),
    "imu": Rule(
        ("sensor_msgs/msg/Imu",),
        r"gyro|mag(netic)?(/|_|$)",
        (r"^/?imu$", r"(camera|kinect|realsense|k4a|oak)[^/]*/imu", r"(^|/)imu", r"imu", r"accel", r"."),
    ),
    "ground_truth": Rule(POSES, r"(?!.*(" + TRUTH + r"))^", (TRUTH,)),
}
# Without an Odometry: what /tf states (`tf_odometry`), else poses whose names say so.
POSE_ODOM = Rule(
    ("geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped"),
    rf"{TRUTH}|initial_?pose|goal|target|amcl|waypoint|set_?point|tag|marker|object",
    (r"odom", r"(^|[/_])(vio|vo|slam|orb\w*)([/_]|$)", r"camera_?pose", r"(^|[/_])(robot_|tracked_|local_)?pose$"),
)
NATIVE = "rgb_to_depth"  # colour in the geometry of the native depth
NATIVE_DEPTH = Rule(PICTURES, RULES["depth"].never + "|depth_to_rgb", (r"depth/image",), DEPTH_ENCODING)
REGISTERED = RULES["depth"].prefer.index(r"depth/image_rect")  # the names before it say that they are registered
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
COMPRESSED = re.compile(r"/(compressed|compressedDepth)$")


def candidates(rule: Rule, topics: Iterable[Topic]) -> list[str]:
    """The names that a rule admits, best first; compressedDepth goes before the same topic as /compressed.

    The latter is JPEG unless its driver was set otherwise.
    """
    fitting = [t.name for t in topics if t.msgtype in rule.types and t.count and may_be(rule, t.name)]
    kept = [name for name in fitting if not (name.endswith("/compressed") and f"{name}Depth" in fitting)]
    return sorted(kept, key=lambda name: (rank(rule, name), len(name), name))


def may_be(rule: Rule, name: str) -> bool:
    """Whether a name is not ruled out, and fits a preference or has the proof that the others need."""
    if fits(rule.never, name):
        return False
    return rank(rule, name) < len(rule.prefer) or fits(rule.proof, name)


def fits(pattern: str, name: str) -> bool:
    """Whether a pattern is in a name; drivers do not agree on capitals either."""
    return re.search(pattern, name, re.IGNORECASE) is not None


def rank(rule: Rule, name: str) -> int:
    base = COMPRESSED.sub("", name)
    return next((i for i, pattern in enumerate(rule.prefer) if fits(pattern, base)), len(rule.prefer))
