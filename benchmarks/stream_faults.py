# SPDX-License-Identifier: Apache-2.0
"""Recordings that are wrong about themselves, made out of right ones.

Each `Kind` changes the messages of a right recording by a magnitude that its random numbers say, and names the causes
that a user should read of it: sections of docs/troubleshooting.md, of which one is enough. Nothing is written to files.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from stream_recording import (
    CAMERA,
    COLOUR,
    COLOUR_INFO,
    DEPTH,
    DEPTH_INFO,
    IMAGE_TYPE,
    INFO_TYPE,
    ODOM,
    ODOM_TYPE,
    TF_STATIC,
    MemoryRecording,
    Stream,
    in_frame,
    restamped,
)

from objreg_ros.bridge.messages import from_msg, headers, motion_from_msg
from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse, pose, rotation_from_quaternion, rotation_from_vector
from objreg_tools.recording.rosbag import messages

Random = np.random.Generator
FRONT_COLOUR, FRONT_INFO, FRONT = "/front/rgb/image_raw", "/front/rgb/camera_info", "front_optical"
FARTHEST_MM = np.iinfo(np.uint16).max
UNKNOWN_POSE = np.eye(6) * 1e-4


@dataclass(frozen=True, eq=False)
class Aside:
    """What a fault may need beside the recording: where the camera truly sits on the body of the odometry, whether
    that body only ever turns about the vertical, and the poses (N, 4, 4) of another robot."""

    T_body_camera: Array
    is_level: bool
    other_poses: Array


@dataclass(frozen=True, eq=False)
class Faulty:
    """A recording with its fault: how large it is, and the true ``T_body_camera`` where that is not what it says."""

    recording: MemoryRecording
    magnitude: dict[str, Any]
    T_body_camera: Array | None = None


Make = Callable[[MemoryRecording, Random, Aside], Faulty]


@dataclass(frozen=True)
class Kind:
    """A kind of fault, the causes that name it, and whether it needs odometry (None: with and without it)."""

    make: Make
    anchors: frozenset[str]
    odometry: bool | None = None


# ------------------------------------------------------------------------------------------------------------ the dice


def log_uniform(rng: Random, low: float, high: float) -> float:
    """A positive number whose logarithm is uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def either_sign(rng: Random) -> float:
    """1 or -1."""
    return float(rng.choice([-1.0, 1.0]))


def random_axis(rng: Random) -> Array:
    """A direction (3,) of length 1, uniform on the sphere."""
    axis = rng.standard_normal(3)
    return np.asarray(axis / np.linalg.norm(axis))


def random_rotation(rng: Random) -> Array:
    """A rotation (3, 3), uniform among all."""
    return rotation_from_quaternion(rng.standard_normal(4))


# ------------------------------------------------------------------------------------------------------------- cameras


def scaled(matrix: Array, focal: float, middle: float = 1.0) -> Array:
    """K (9,) or P (12,) with the focal lengths and the principal point scaled."""
    rows = np.array(matrix, float).reshape(3, -1)
    rows[[0, 1], [0, 1]] *= focal
    rows[:2, 2] *= middle
    return rows.ravel()


def shifted(matrix: Array, across: float, down: float) -> Array:
    """K (9,) or P (12,) with the principal point moved by so many pixels."""
    rows = np.array(matrix, float).reshape(3, -1)
    rows[:2, 2] += across, down
    return rows.ravel()


def with_matrices(info: Any, change: Callable[[Array], Array]) -> Any:
    """A CameraInfo with K and P changed alike; a P of zeros stays one."""
    return replace(info, k=change(info.k), p=change(info.p))


def _cameras(recording: MemoryRecording, change: Callable[[Any], Any]) -> MemoryRecording:
    """Every camera_info changed alike."""
    return recording.altered(COLOUR_INFO, change).altered(DEPTH_INFO, change)


def _size(recording: MemoryRecording) -> tuple[int, int]:
    info = recording.messages(DEPTH_INFO)[0]
    return int(info.width), int(info.height)


def focal(recording: MemoryRecording, rng: Random, aside: Aside) -> Faulty:
    """Focal lengths in K and P that are 2 to 60 % too long or too short."""
    factor = 1.0 + either_sign(rng) * log_uniform(rng, 0.02, 0.6)
    change = partial(with_matrices, change=partial(scaled, focal=factor))
    return Faulty(_cameras(recording, change), {"factor": factor})


def depth_camera(recording: MemoryRecording, rng: Random, aside: Aside) -> Faulty:
    """Depth is registered to colour, and its camera_info is still that of the depth camera."""
    factor, (width, height) = float(rng.uniform(0.6, 0.9)), _size(recording)
    across, down = (float(rng.uniform(-0.03, 0.03)) * side for side in (width, height))

    def change(matrix: Array) -> Array:
        return shifted(scaled(matrix, factor), across, down)

    wrong = recording.altered(DEPTH_INFO, partial(with_matrices, change=change))
    return Faulty(wrong, {"factor": factor, "shift_px": [across, down]})


def stale_projection(recording: MemoryRecording, rng: Random, aside: Aside) -> Faulty:
    """P is that of a picture of twice or half the size; K is right."""
    factor = float(rng.choice([0.5, 2.0]))
    wrong = _cameras(recording, lambda info: replace(info, p=scaled(info.p, factor, factor)))
    return Faulty(wrong, {"factor": factor})


def default_projection(recording: MemoryRecording, rng: Random, aside: Aside) -> Faulty:
    """P is that of a default camera: a picture of half the size, a view 60 to 100 degrees wide; K is right."""
    wide_deg, (width, height) = float(rng.uniform(60.0, 100.0)), _size(recording)
    f = 0.25 * width / np.tan(np.radians(wide_deg / 2))
    P = np.array([f, 0.0, width / 4, 0.0, 0.0, f, height / 4, 0.0, 0.0, 0.0, 1.0, 0.0])
    return Faulty(_cameras(recording, lambda info: replace(info, p=P)), {"wide_deg": wide_deg})


def middle_outside(recording: MemoryRecording, rng: Random, aside: Aside) -> Faulty:
    """The principal point is beside the picture, or in its outermost tenth."""
    (width, height), share = _size(recording), either_sign(rng) * float(rng.uniform(0.4, 1.0))
    across, down = (share * width, 0.0) if rng.random() < 0.5 else (0.0, share * height)
    return _moved_middle(recording, across, down)


def middle_aside(recording: MemoryRecording, rng: Random, aside: Aside) -> Faulty:
    """The principal point is 5 to 25 % of the width aside, in any direction."""
    by, angle = float(rng.uniform(0.05, 0.25)) * _size(recording)[0], float(rng.uniform(0, 2 * np.pi))
    return _moved_middle(recording, by * np.cos(angle), by * np.sin(angle))


def _moved_middle(recording: MemoryRecording, across: float, down: float) -> Faulty:
    change = partial(with_matrices, change=partial(shifted, across=across, down=down))
    return Faulty(_cameras(recording, change), {"shift_px": [across, down]})


# ------------------------------------------------------------------------------------------------------------ pictures


def scaled_depth(message: Any, factor: float) -> Any:
    """A depth image with other distances; steps that 16 bits do not hold become 0, which is not measured."""
    metric = message.encoding == "32FC1"
    pixels = message.data.view(np.float32 if metric else np.uint16) * np.float32(factor)
    if not metric:
        pixels = np.where(np.rint(pixels) > FARTHEST_MM, 0, np.rint(pixels)).astype(np.uint16)
    return replace(message, data=pixels.astype(np.float32 if metric else np.uint16).view(np.uint8))


def depth_scale(recording: MemoryRecording, rng: Random, aside: Aside) -> Faulty:
    """Distances are 0.3 to 3 times the true ones, and not within 5 % of them."""
    factor = log_uniform(rng, 0.3, 3.0)
    while abs(factor - 1.0) < 0.05:
        factor = log_uniform(rng, 0.3, 3.0)
    return Faulty(recording.altered(DEPTH, partial(scaled_depth, factor=factor)), {"factor": factor})


def mirrored(message: Any, stamp_ns: int, frame_id: str) -> Any:
    """A colour picture with left and right exchanged, of another time."""
    return messages.image(from_msg.image(message).rgb[:, ::-1], "rgb8", stamp_ns, frame_id)


def elsewhere(recording: MemoryRecording, frame_id: str) -> Stream:
    """What another camera sees at the times of the colour pictures: other parts of the recording, mirrored."""
    moments = recording.streams[COLOUR].moments
    others = [moments[(k * 7 + len(moments) // 2) % len(moments)][1] for k in range(len(moments))]
    made = [(ns, partial(_mirrored, make, other, frame_id)) for (ns, make), other in zip(moments, others, strict=True)]
    return Stream(IMAGE_TYPE, tuple(made))


def _mirrored(make: Callable[[], Any], other: Callable[[], Any], frame_id: str) -> Any:
    return mirrored(other(), headers.stamp_ns(make()), frame_id)


def _front_camera(recording: MemoryRecording, rng: Random) -> Stream:
    factor = float(rng.uniform(0.8, 1.2))
    change = partial(with_matrices, change=partial(scaled, focal=factor))
    return replace(
        recording.streams[COLOUR_INFO].altered(change).altered(partial(in_frame, frame_id=FRONT)), msgtype=INFO_TYPE
    )


def other_colour(recording: MemoryRecording, rng: Random, aside: Aside) -> Faulty:
    """Colour is another camera's: under its own name, or under that of the camera which measures depth."""
    if rng.random() < 0.5:
        return Faulty(recording.having({COLOUR: elsewhere(recording, CAMERA)}), {"named": COLOUR})
    front = {FRONT_COLOUR: elsewhere(recording, FRONT), FRONT_INFO: _front_camera(recording, rng)}
    return Faulty(recording.having(front).without(COLOUR, COLOUR_INFO), {"named": FRONT_COLOUR})


def two_cameras(recording: MemoryRecording, rng: Random, aside: Aside) -> Faulty:
    """A colour camera that looks elsewhere is beside the one that goes with depth."""
    front = {FRONT_COLOUR: elsewhere(recording, FRONT), FRONT_INFO: _front_camera(recording, rng)}
    return Faulty(recording.having(front), {})


def late_pictures(recording: MemoryRecording, rng: Random, aside: Aside) -> Faulty:
    """The stamps of colour or of depth are 30 to 300 ms behind or ahead of the other's."""
    topic, ms = str(rng.choice([COLOUR, DEPTH])), either_sign(rng) * float(rng.uniform(30.0, 300.0))
    wrong = recording.altered(topic, partial(restamped, shift_ns=round(ms * 1e6)))
    return Faulty(wrong, {"topic": topic, "ms": ms})


# ------------------------------------------------------------------------------------------------------------ odometry


def odometry_poses(recording: MemoryRecording) -> Array:
    """``T_odom_body (N, 4, 4)``."""
    return np.array([motion_from_msg.odometry(message).T_odom_body for message in recording.messages(ODOM)])


def with_poses(recording: MemoryRecording, T_odom_body: Array) -> MemoryRecording:
    """The recording with other poses in its odometry, at the same times."""
    old = zip(recording.streams[ODOM].moments, recording.messages(ODOM), T_odom_body, strict=True)
    made = [(ns, _odometry(m, T)) for (ns, _), m, T in old]
    return recording.having({ODOM: Stream.of(ODOM_TYPE, made)})


def _odometry(message: Any, T_odom_body: Array) -> Any:
    ns, frame_id = headers.stamp_ns(message), message.header.frame_id
    return messages.odometry(T_odom_body, UNKNOWN_POSE, ns, frame_id, message.child_frame_id)


def other_robot(recording: MemoryRecording, rng: Random, aside: Aside) -> Faulty:
    """Odometry is of a robot that goes elsewhere: another one's, or this one's played backwards."""
    own, how = odometry_poses(recording), str(rng.choice(["other", "backwards"]))
    if how == "other":
        at = np.linspace(0, len(aside.other_poses) - 1, len(own)).round().astype(int)
        poses = aside.other_poses[at] @ inverse(aside.T_body_camera)
    else:
        poses = own[::-1]
    return Faulty(with_poses(recording, poses), {"how": how})


def odometry_clock(recording: MemoryRecording, rng: Random, aside: Aside) -> Faulty:
    """Odometry is stamped by a clock that is 0.3 to 50 s ahead or behind."""
    seconds = either_sign(rng) * log_uniform(rng, 0.3, 50.0)
    return Faulty(recording.altered(ODOM, partial(restamped, shift_ns=round(seconds * 1e9))), {"seconds": seconds})


def odometry_gaps(recording: MemoryRecording, rng: Random, aside: Aside) -> Faulty:
    """Odometry stops early or begins late: there is some for 10 to 80 % of the time."""
    share, ends = float(rng.uniform(0.1, 0.8)), bool(rng.random() < 0.5)
    moments = recording.streams[ODOM].moments
    count = max(2, round(share * len(moments)))
    kept = moments[:count] if ends else moments[-count:]
    return Faulty(recording.having({ODOM: Stream(ODOM_TYPE, kept)}), {"share": share, "stops_early": ends})


def mount_unknown(recording: MemoryRecording, rng: Random, aside: Aside) -> Faulty:
    """The camera sits on the body anyhow, up to half a metre off, and no /tf_static says how.

    On a body that turns about the vertical only, it is turned about that only too: the body stays level.
    """
    turn = np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)])
    offset = random_axis(rng) * float(rng.uniform(0.0, 0.5))
    if aside.is_level:
        T_body_camera = pose(rotation_from_vector(turn), offset) @ aside.T_body_camera
    else:
        T_body_camera = pose(random_rotation(rng), offset)
    poses = odometry_poses(recording) @ aside.T_body_camera @ inverse(T_body_camera)
    wrong = with_poses(recording, poses).without(TF_STATIC)
    return Faulty(wrong, {"T_body_camera": T_body_camera.round(4).tolist()}, T_body_camera)


def mount_wrong(recording: MemoryRecording, rng: Random, aside: Aside) -> Faulty:
    """The camera is turned by 20 to 180 degrees from where /tf_static says that it sits on the body."""
    degrees = float(rng.uniform(20.0, 180.0))
    turn = pose(rotation_from_vector(np.radians(degrees) * random_axis(rng)), np.zeros(3))
    wrong = recording.altered(TF_STATIC, partial(_remounted, T_body_camera=aside.T_body_camera @ turn))
    return Faulty(wrong, {"degrees": degrees}, aside.T_body_camera)


def static_transform(T_parent_child: Array, stamp_ns: int, parent: str, child: str) -> Any:
    """tf2_msgs/TFMessage of one transform."""
    placed = messages.pose(T_parent_child)
    where = messages.message("geometry_msgs/Vector3", x=placed.position.x, y=placed.position.y, z=placed.position.z)
    one = messages.message(
        "geometry_msgs/TransformStamped",
        header=messages.header(stamp_ns, parent),
        child_frame_id=child,
        transform=messages.message("geometry_msgs/Transform", translation=where, rotation=placed.orientation),
    )
    return messages.message("tf2_msgs/TFMessage", transforms=[one])


def _remounted(message: Any, T_body_camera: Array) -> Any:
    old = message.transforms[0]
    ns = headers.stamp_ns(old)
    return static_transform(T_body_camera, ns, old.header.frame_id, old.child_frame_id)


def nothing_wrong(recording: MemoryRecording, rng: Random, aside: Aside) -> Faulty:
    """The recording as it is."""
    return Faulty(recording, {})


RIGHT = "right"
KINDS = {
    RIGHT: Kind(nothing_wrong, frozenset()),
    "focal": Kind(focal, frozenset({"camera-focal-length"})),
    "depth_camera": Kind(depth_camera, frozenset({"camera-focal-length", "camera-disagrees"})),
    "stale_projection": Kind(stale_projection, frozenset({"camera-matrices-disagree"})),
    "default_projection": Kind(default_projection, frozenset({"camera-matrices-disagree"})),
    "middle_outside": Kind(middle_outside, frozenset({"camera-principal-point"})),
    "middle_aside": Kind(middle_aside, frozenset({"camera-principal-point"})),
    "depth_scale": Kind(depth_scale, frozenset({"depth-scale"}), odometry=True),
    "other_colour": Kind(other_colour, frozenset({"colour-of-another-camera"})),
    "two_cameras": Kind(two_cameras, frozenset({"colour-of-another-camera"})),
    "late_pictures": Kind(late_pictures, frozenset({"streams-apart"})),
    "other_robot": Kind(other_robot, frozenset({"odometry-of-another-robot"}), odometry=True),
    "odometry_clock": Kind(odometry_clock, frozenset({"odometry-clock"}), odometry=True),
    "odometry_gaps": Kind(odometry_gaps, frozenset({"odometry-gaps"}), odometry=True),
    "mount_unknown": Kind(mount_unknown, frozenset({"mount-unknown"}), odometry=True),
    "mount_wrong": Kind(mount_wrong, frozenset({"mount-wrong"}), odometry=True),
}
FAULT_ANCHORS = frozenset[str]().union(*(kind.anchors for kind in KINDS.values()))
