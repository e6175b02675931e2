# SPDX-License-Identifier: Apache-2.0
"""The decoders under attack: what goes in, what is done with it, and what of the answer must be true.

What decodes is written again and serialised, as a node would publish it, and must come back with its stamp.
"""

from __future__ import annotations

import random
import zlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from mutation import mutated
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import String
from trials import Attempt, Target, WrongAnswerError

from objreg_ros.bridge.messages import camera_from_msg, from_msg, headers, motion_from_msg, to_msg
from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import Frame, ObjectCloud, View
from objreg_ros.data.frames import Odometry as OdometryData
from objreg_ros.data.images import ColourImage, DepthImage, Detections, Intrinsics, PointCloud
from objreg_ros.geometry import back_project
from objreg_ros.segmenter.sensor.organise import organise
from objreg_tools.simulation.drawn_place import drawn

SMALL = Intrinsics(fx=35.0, fy=35.0, cx=19.5, cy=14.5, width=40, height=30)
SECOND = 1_000_000_000
NAMES = {0: "cup", 1: "tv", 2: "book", 65_533: "last"}
DEEP = 100_000
MOST_WRITTEN = 1 << 20  # pixels: more of them only cost time
BIG = "{" + ", ".join(f'"{k}": "x"' for k in range(DEEP)) + "}"
Use = Callable[..., None]


# -------------------------------------------------------------------------------------------------------- good messages


def depth_image(stamp_ns: int = SECOND, camera: Intrinsics = SMALL) -> DepthImage:
    """A block before a slanting wall."""
    v = np.mgrid[: camera.height, : camera.width][0]
    depth = (1.4 - 0.3 * v / camera.height).astype(np.float32)
    depth[camera.height // 3 : camera.height // 2, camera.width // 3 : camera.width // 2] -= 0.2
    return DepthImage(depth=depth, rgb=colour_image(stamp_ns, camera).rgb, intrinsics=camera, stamp_ns=stamp_ns)


def colour_image(stamp_ns: int = SECOND, camera: Intrinsics = SMALL) -> ColourImage:
    """A picture with a pattern."""
    v, u = np.mgrid[: camera.height, : camera.width]
    grey = ((u * 7 + v * 13) % 256).astype(np.uint8)
    return ColourImage(rgb=np.repeat(grey[..., None], 3, axis=-1), stamp_ns=stamp_ns)


def two_detections(stamp_ns: int = SECOND, camera: Intrinsics = SMALL) -> Detections:
    """Two boxes."""
    share = np.array([[0.3, 0.3, 0.6, 0.6], [0.0, 0.5, 0.5, 1.0]], np.float32)
    xyxy = share * np.array([camera.width, camera.height] * 2, np.float32)
    score, hw = np.array([0.9, 0.6], np.float32), (camera.height, camera.width)
    return Detections(xyxy=xyxy, score=score, label=("cup", "tv"), image_hw=hw, stamp_ns=stamp_ns)


def drawn_frame(stamp_ns: int = SECOND, step: int = 4) -> Frame:
    """The registrar's drawn place, its view and its objects thinned."""
    full = drawn(stamp_ns)
    camera = full.view.intrinsics.scaled(step)
    part = (slice(step // 2, None, step), slice(step // 2, None, step))
    grey = None if full.view.grey is None else full.view.grey[part]
    view = View(xyz=full.view.xyz[part], grey=grey, intrinsics=camera)
    return replace(full, view=view, objects=tuple(_thinned(item, step) for item in full.objects))


def _thinned(item: ObjectCloud, step: int) -> ObjectCloud:
    rgb = None if item.rgb is None else item.rgb[::step]
    xyz, normals, flags = item.xyz[::step], item.normals[::step], item.flags[::step]
    return replace(item, xyz=xyz, normals=normals, rgb=rgb, flags=flags)


def frame_messages(frame: Frame) -> tuple[Any, ...]:
    """objects, view, view/camera_info, gravity and labels."""
    parts = to_msg.objects(frame, NAMES), to_msg.view(frame), to_msg.view_camera_info(frame), to_msg.gravity(frame)
    return (*parts, to_msg.labels(NAMES))


def odometry_message(stamp_ns: int = SECOND, x: float = 0.0) -> Odometry:
    """A body at x."""
    T = np.eye(4)
    T[0, 3] = x
    return to_msg.odometry(OdometryData(T_odom_body=T, stamp_ns=stamp_ns))


def constraint_message(from_ns: int = SECOND, to_ns: int = 9 * SECOND, x: float = 0.0) -> Odometry:
    """A camera that came back to within x."""
    T = np.eye(4)
    T[0, 3] = x
    covariance = np.eye(6) * 1e-4
    return to_msg.constraint(
        LoopClosure(from_ns=from_ns, to_ns=to_ns, T_from_to=T, covariance=covariance, labels=("cup",))
    )


def _encoded(image: ColourImage) -> list[Any]:
    """The same picture raw in every encoding, and compressed by whatever OpenCV writes."""
    grey = image.rgb[..., 0]
    four = np.dstack([image.rgb, grey])
    rasters: dict[str, Any] = {"rgb8": image.rgb, "bgr8": image.rgb, "8UC3": image.rgb}
    rasters |= dict.fromkeys(("rgba8", "bgra8", "8UC4"), four) | {"mono8": grey, "8UC1": grey}
    rasters["mono16"] = grey.astype(np.uint16) * 256
    raw = [to_msg._raster(pixels, name, SECOND, "camera") for name, pixels in rasters.items()]
    header = to_msg.header(SECOND, "camera")
    kinds = [kind for kind in ("png", "jpg", "bmp", "tiff", "webp", "ppm", "gif") if cv2.haveImageWriter(f".{kind}")]
    files = [(kind, cv2.imencode(f".{kind}", image.rgb)[1].tobytes()) for kind in (*kinds[:2] * 4, *kinds)]
    small = [CompressedImage(header=header, format=kind, data=data) for kind, data in files]
    return [*raw, *small, CompressedImage(header=header, format="png", data=bomb(8_000, 1))]


def bomb(side: int, bits: int) -> bytes:
    """A png of one grey of so many pixels a side."""
    head = side.to_bytes(4, "big") * 2 + bytes([bits, 0, 0, 0, 0])
    packer, line = zlib.compressobj(1), bytes(1 + side * bits // 8)
    lines = b"".join(packer.compress(line) for _ in range(side)) + packer.flush()
    chunks = ((b"IHDR", head), (b"IDAT", lines), (b"IEND", b""))
    parts = (len(d).to_bytes(4, "big") + n + d + zlib.crc32(n + d).to_bytes(4, "big") for n, d in chunks)
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


def _encoded_depth(image: DepthImage) -> list[Any]:
    header, millimetres = to_msg.header(SECOND, "camera"), np.rint(image.depth * 1000).astype(np.uint16)
    png = cv2.imencode(".png", millimetres)[1].tobytes()
    constants = b"\0\0\0\0" + np.array([100.0, 0.0], "<f4").tobytes()
    files = {"16UC1; compressedDepth": bytes(12) + png, "32FC1; compressedDepth png": constants + png, "png": png}
    small = [CompressedImage(header=header, format=kind, data=data) for kind, data in files.items()]
    return [to_msg.depth_image(image), to_msg.depth_image(image, True), *small]


def clouds(image: DepthImage) -> list[Any]:
    """Organised and not, with colour and without."""
    camera = image.intrinsics
    xyz = back_project(image.depth, camera.fx, camera.fy, camera.cx, camera.cy).astype(np.float32)
    flat = xyz.reshape(1, -1, 3)
    cut = [(xyz, image.rgb), (xyz, None), (flat, image.rgb.reshape(1, -1, 3)), (flat, None)]  # type: ignore[union-attr]
    return [to_msg.points(PointCloud(xyz=points, rgb=rgb, stamp_ns=SECOND)) for points, rgb in cut]


# --------------------------------------------------------------------------------------------------------------- labels


def any_labels(draw: random.Random) -> String:
    """JSON that is a table of labels, almost is, or is none."""
    keys = (
        "0",
        "-1",
        "1",
        "65533",
        "65534",
        "65535",
        "65536",
        "70000",
        "2147483648",
        "1e400",
        "NaN",
        "",
        "x",
        "9" * 5000,
        "٣",
    )
    values = ('"cup"', '"\\ud800"', '"\\udfff\\ud800"', '""', "null", "1e400", "[]", "{}", "NaN", f'"{"x" * 10_000}"',
              '"support"', '"7"', '"65535"', '"99999"', '"cup\\u0000"', '"' + "9" * 5000 + '"', "9" * 5000)  # fmt: skip
    deep = ("[" * DEEP, '{"0":' * DEEP, '{"0":' + "[" * DEEP + "]" * DEEP + "}", "{" * DEEP, BIG)
    others = ("", "null", "[]", "0", '"x"', "{", '{"0"}', "{0:1}", "\0", "9" * 5000, "[9e999]", *deep)
    if draw.random() < 0.1:
        return String(data=draw.choice(others))
    rows = [f'"{draw.choice(keys)}": {draw.choice(values)}' for _ in range(draw.choice((1, 1, 2, 3, 5)))]
    return String(data="{" + ", ".join(rows) + "}")


def any_constraint(draw: random.Random, message: Odometry) -> Odometry:
    """A constraint between moments that may not be."""
    seconds = ("1", "-1", "0", "", "-", "--1", "+1", "٣", "1e9", "9" * 4000, "9" * 20, "2147483647", "2147483648", "²")
    nanoseconds = (
        "000000000",
        "999999999",
        "000000001",
        "00000000",
        "0000000000",
        "٣٣٣٣٣٣٣٣٣",
        "",
        "-00000001",
        "²" * 9,
    )
    where = ("camera", "", "a@b", "x" * 1000, "\0", "camera@1.000000000/cup_1")
    made = from_msg_copy(message)
    if draw.random() < 0.5:
        made.header.frame_id = f"{draw.choice(where)}@{draw.choice(seconds)}.{draw.choice(nanoseconds)}"
    if draw.random() < 0.5:
        made.child_frame_id = f"{draw.choice(where)}@{draw.choice(seconds)}.{draw.choice(nanoseconds)}"
    return made


def from_msg_copy(message: Any) -> Any:
    """A message that shares nothing with another."""
    return deserialize_message(serialize_message(message), type(message))


# ----------------------------------------------------------------------------------------------------- decode and write


def written(message: Any, stamp_ns: int | None = None) -> Any:
    """The message as another node would get it; WrongAnswerError if its stamp is another by then."""
    got = deserialize_message(serialize_message(message), type(message))
    if stamp_ns is not None and headers.stamp_ns(got) != stamp_ns:
        raise WrongAnswerError(f"the stamp {stamp_ns} ns was written as {headers.stamp_ns(got)} ns")
    return got


def use_image(message: Any) -> None:
    """As the detector reads it."""
    image = from_msg.image(message)
    if image.rgb.size < MOST_WRITTEN:
        written(to_msg.image(image), image.stamp_ns)


def use_depth(message: Any, info: Any, colour: Any) -> None:
    """As the segmenter reads depth."""
    image = from_msg.depth_image(message, info, colour)
    if not (np.isfinite(image.depth) & (image.depth >= 0)).all():
        raise WrongAnswerError(f"depth: NaN, infinite or negative: {image.depth.min()} … {image.depth.max()}")
    if image.depth.size < MOST_WRITTEN:
        written(to_msg.depth_image(image), image.stamp_ns)


def use_info(info: Any) -> None:
    """As every node reads a camera."""
    camera_from_msg.is_calibrated(info)
    written(to_msg.camera_info(camera_from_msg.intrinsics(info), headers.stamp_ns(info), "camera"))


def use_cloud(message: Any, info: Any) -> None:
    """As the segmenter reads a cloud."""
    cloud = from_msg.point_cloud(message)
    depth = organise(cloud, camera_from_msg.camera_of_cloud(info, cloud))
    if depth.depth.size < MOST_WRITTEN:
        written(to_msg.depth_image(depth), cloud.stamp_ns)


def use_detections(message: Any, said: Any) -> None:
    """As the segmenter reads detections, and as the detector writes them."""
    names = from_msg.labels(said)
    detections = from_msg.detections(message, names, (30, 40))
    written(to_msg.labels(names))
    written(to_msg.detections_table(detections, names), detections.stamp_ns)


def use_odometry(before: Any, after: Any) -> None:
    """As registrar and mapper read odometry."""
    odometry = [motion_from_msg.odometry(before), motion_from_msg.odometry(after)]
    between = (odometry[0].stamp_ns + odometry[1].stamp_ns) // 2
    T = motion_from_msg.pose_at(between, odometry)
    motion_from_msg.level_gravity(between, odometry)
    if not np.isfinite(T).all():
        raise WrongAnswerError(f"a pose between two is {T.tolist()}")
    written(to_msg.odometry(odometry[0]), odometry[0].stamp_ns)


def use_constraint(message: Any) -> None:
    """As the mapper reads a constraint."""
    closure = from_msg.loop_closure(message)
    written(to_msg.constraint(closure), closure.to_ns)
    written(to_msg.finished("mapper", closure.to_ns), closure.to_ns)


def use_frame(objects: Any, view: Any, info: Any, gravity: Any, said: Any, before: Any, after: Any) -> None:
    """As the registrar reads a frame, and as the segmenter writes it."""
    names = from_msg.labels(said)
    odometry = [motion_from_msg.odometry(before), motion_from_msg.odometry(after)]
    frame = from_msg.frame(objects, view, info, gravity, names, odometry)
    written(to_msg.objects(frame, names), frame.stamp_ns)
    for message in (to_msg.view(frame), to_msg.view_camera_info(frame), to_msg.gravity(frame)):
        written(message, frame.stamp_ns)


def trial(goods: Sequence[tuple[Any, ...]], use: Use, draw: random.Random) -> None:
    """Spoil one or more of the messages that belong together, and use them."""
    messages = list(draw.choice(goods))
    one = draw.randrange(len(messages))
    chosen = [k for k in range(len(messages)) if k == one or draw.random() < 0.15]
    for k in chosen:
        messages[k] = spoilt(draw, messages[k])
    if len(messages) > 1:
        messages = _of_one_stamp(draw, messages)
    use(*messages)


def spoilt(draw: random.Random, message: Any) -> Any:
    """A mutated message; a String is labels, an Odometry of two moments a constraint."""
    if isinstance(message, String):
        return any_labels(draw) if draw.random() < 0.8 else mutated(draw, message)
    if isinstance(message, Odometry) and "@" in message.child_frame_id and draw.random() < 0.3:
        message = any_constraint(draw, message)
    return mutated(draw, message)


def _of_one_stamp(draw: random.Random, messages: list[Any]) -> list[Any]:
    """As the synchroniser gives them: what does not have the stamp of the first does not come with it."""
    if draw.random() < 0.05:
        return messages
    made = []
    for message in messages:
        if hasattr(message, "header") and not isinstance(message, Odometry):
            message = from_shell(message)
            message.header = messages[0].header
        made.append(message)
    return made


def from_shell(message: Any) -> Any:
    """The same message in another shell: its header may be another."""
    made: Any = object.__new__(type(message))
    for slot in message.__slots__:
        setattr(made, slot, getattr(message, slot))
    return made


Goods = Callable[[], list[tuple[Any, ...]]]


def _depths() -> list[tuple[Any, ...]]:
    image = depth_image()
    info, colours = to_msg.camera_info(image.intrinsics, SECOND, "camera"), _encoded(colour_image())[:12]
    return [(depth, info, colours[k % len(colours)]) for k, depth in enumerate(_encoded_depth(image) * 3)]


def _clouds() -> list[tuple[Any, ...]]:
    info = to_msg.camera_info(SMALL, SECOND, "camera")
    return [(cloud, info) for cloud in clouds(depth_image())]


def _frames() -> list[tuple[Any, ...]]:
    full = drawn_frame()
    bare = replace(full, objects=tuple(replace(o, rgb=None) for o in full.objects), support=None)
    ends = odometry_message(), odometry_message(2 * SECOND, 0.1)
    return [(*frame_messages(frame), *ends) for frame in (full, bare, replace(full, objects=(), gravity=None))]


DECODERS: dict[str, tuple[Goods, Use, float]] = {
    "image": (lambda: [(m,) for m in _encoded(colour_image())], use_image, 1.0),
    "depth": (_depths, use_depth, 1.0),
    "camera_info": (lambda: [(to_msg.camera_info(SMALL, SECOND, "camera"),)], use_info, 0.7),
    "points": (_clouds, use_cloud, 1.0),
    "detections": (lambda: [(to_msg.detections_table(two_detections(), NAMES), to_msg.labels(NAMES))],
                   use_detections, 1.0),
    "odom": (lambda: [(odometry_message(), odometry_message(2 * SECOND, 0.1))], use_odometry, 0.7),
    "constraints": (lambda: [(constraint_message(),)], use_constraint, 0.7),
    "frame": (_frames, use_frame, 1.5),
}  # fmt: skip


def decoder_attempt(name: str, _: Path | None = None) -> Attempt:
    """What one trial of a decoder does."""
    goods, use, _share = DECODERS[name]
    return partial(trial, goods(), use)


TARGETS = [Target(name, partial(decoder_attempt, name), share) for name, (*_, share) in DECODERS.items()]
