# SPDX-License-Identifier: Apache-2.0
"""The topics of one camera and of one robot, by their names and by the frames of their first messages.

A name is cut into the parts of its folders. What says the kind of a picture (rgb, depth, aligned, image) is left out;
what remains names the camera: `/spot/depth_registered/frontleft/image` is spot, frontleft.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping

TRANSPORT = re.compile(r"/(compressed|compressedDepth)$")
PART = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")
SENSOR = re.compile(r"sensor_\d+")  # realsense-viewer has a folder for each kind of picture
KINDS = frozenset(
    [
        "rgb",
        "color",
        "colour",
        "depth",
        "registered",
        "aligned",
        "align",
        "to",
        "image",
        "img",
        "raw",
        "rect",
        "rectified",
        "mono",
        "points",
        "point",
        "pointcloud",
        "cloud",
        "xyz",
        "xyzrgb",
        "data",
        "info",
        "frame",
        "stereo",
        "ir",
        "infra",
        "hw",
        "sw",
        "hd",
        "qhd",
        "sd",
        "preview",
        "resize",
        "resized",
        "pcl",
        "ground",
        "truth",
        "video",
        "stream",
    ]
)
OF_FRAMES = KINDS | {"optical", "link"}
GENERIC = frozenset(("camera", "cam", "node", "sensor", "ros", "driver"))
HALVES = frozenset(("left", "right"))  # of a camera with two lenses
SIDE = frozenset(("arm", "wrist", "hand", "gripper", "rear", "back", "down", "bottom"))  # less probably meant
FRONT = re.compile(r"front|head|main|cent(er|re)")
CAMERA = re.compile(
    r"cam|sensor|kinect|realsense|^rs|^[dltr]\d{3}|zed|oak|k4a|azure|orbbec|astra|xtion|device|front|rear"
)
SAME, GENERICALLY_SAME, HALF, BY_FRAME = range(4)


def camera_words(name: str) -> tuple[str, ...]:
    """The parts that name the camera in the topic of a picture, a cloud or a camera_info."""
    folders = TRANSPORT.sub("", name).strip("/").split("/")
    if folders[-1].lower() in ("camera_info", "points2"):
        folders.pop()
    return tuple(part for folder in folders if not SENSOR.fullmatch(folder) for part in _parts(folder, KINDS))


def relation(one: str, other: str, frames: Mapping[str, str] | None = None) -> int | None:
    """How sure two topics are of one camera, 0 is most; None if they are of two. ``frames``: topic -> its frame."""
    frame, other_frame = ((frames or {}).get(topic, "") for topic in (one, other))
    words, other_words = camera_words(one), camera_words(other)
    by_name = _relation_of(words, other_words)
    if by_name is None:
        is_shared = bool(frame) and frame == other_frame and not are_twins(robot_of(one), robot_of(other), ())
        return BY_FRAME if is_shared else None
    if not _contradict(frame, other_frame) or (by_name == SAME and _specific(words)):
        return by_name
    return None


def share_frame(one: str, other: str, frames: Mapping[str, str] | None) -> bool | None:
    """Whether two topics are measured in one frame; None where that is not known."""
    first, second = ((frames or {}).get(topic, "") for topic in (one, other))
    return first == second if first and second else None


def robot_of(name: str) -> str:
    """The first folder of a name, which may be a robot's; empty where it has none, and where it is a camera's."""
    first, _, rest = name.strip("/").partition("/")
    return first if rest and not CAMERA.search(first.lower()) and _parts(first, KINDS) else ""


def are_twins(robot: str, other: str, names: Collection[str]) -> bool:
    """Whether two first folders are of two robots: they differ by number, or hold a topic of the same name."""
    if not robot or not other or robot == other:
        return False
    stem, other_stem = (re.sub(r"(\d+|(?<=_)[a-z])$", "", folder.lower()) for folder in (robot, other))
    if stem == other_stem:
        return True
    return any(f"/{other}/{name.strip('/').partition('/')[2]}" in names for name in names if robot_of(name) == robot)


def _parts(folder: str, kinds: frozenset[str]) -> list[str]:
    return [part for part in map(str.lower, PART.findall(folder)) if part not in kinds]


def _specific(words: Collection[str]) -> list[str]:
    return [part for part in words if part not in GENERIC]


def _relation_of(words: tuple[str, ...], others: tuple[str, ...]) -> int | None:
    if words == others:
        return SAME
    specific, others_specific = sorted(_specific(words)), sorted(_specific(others))
    if words and others and specific == others_specific:
        return GENERICALLY_SAME
    apart = set(specific) ^ set(others_specific)
    is_shared = bool(set(words) & set(others)) or () in (words, others)  # /left/image_rect and /depth
    is_half = apart <= HALVES and len(apart) == 1 and is_shared
    return HALF if is_half else None


def _contradict(frame: str, other: str) -> bool:
    """Whether two frames name two cameras: each has a part that the other lacks."""
    words, others = (
        set(_specific([p for f in name.split("/") for p in _parts(f, OF_FRAMES)])) for name in (frame, other)
    )
    return bool(words - others - HALVES and others - words - HALVES)
