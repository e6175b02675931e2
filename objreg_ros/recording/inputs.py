# SPDX-License-Identifier: Apache-2.0
"""Which topics of a recording go to which input of the graph: by type, then by the names that drivers use.

Drivers do not agree on names, so a choice is a ranking: the first pattern that fits wins, and what `--remap` names wins
over everything.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields

from objreg_ros.recording.record import Topic

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
# A word before a folder of colour is a camera's name: /depth_cam/rgb/image_raw, /right_arm/camera/color/image_raw.
IS_KIND = rf"(?!.*{COLOUR_FOLDER})"
HALF_OF_STEREO = rf"(^|/)(left|right)(/|$)|(?<![a-z])(left|right){IS_KIND}"

# The first of two pictures that fit equally is the one of the shorter name: raw before compressed.
RULES = {
    "image": Rule(
        PICTURES,
        rf"(?<!rgb_to_)depth{IS_KIND}|(^|/)ir(/|_|$)|infra|disparity|mask|label|(^|/)theora"
        rf"|objects|(^|/)view(/|$)|{HALF_OF_STEREO}|{STEREO}|{DEPTH_ENCODING}",
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
        rf"(^|/)ir(/|_|$)|infra|rgb_to_depth|disparity|{COLOUR_FOLDER}(?!.*[dD]epth)",
        (
            r"^/?depth/image$",
            r"depth_registered/hw_registered/image_rect",
            r"depth_registered/.*image_rect",
            r"depth_registered/",
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
    "odom": Rule(("nav_msgs/msg/Odometry",), TRUTH, (r"^/?odom$", r"odom", r".")),
    "imu": Rule(
        ("sensor_msgs/msg/Imu",),
        r"gyro|mag(netic)?(/|_|$)",
        (r"^/?imu$", r"(camera|kinect|realsense|k4a|oak)[^/]*/imu", r"(^|/)imu", r"imu", r"accel", r"."),
    ),
    "ground_truth": Rule(POSES, r"(?!.*(" + TRUTH + r"))^", (TRUTH,)),
}
# Without an Odometry: what /tf tells (`tf_odometry`), else poses whose names say so.
POSE_ODOM = Rule(
    ("geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped"),
    rf"{TRUTH}|initial_?pose|goal|target|amcl|waypoint|set_?point|tag|marker|object",
    (r"odom", r"(^|[/_])(vio|vo|slam|orb\w*)([/_]|$)", r"camera_?pose", r"(^|[/_])(robot_|tracked_|local_)?pose$"),
)
TF_ODOM, TF_TRUTH = "/tf/odom", "/tf/ground_truth"  # made of the /tf of a recording, which has no topics of these names
DERIVED = {"odom": TF_ODOM, "ground_truth": TF_TRUTH}
NATIVE = "rgb_to_depth"  # colour in the geometry of the native depth
NATIVE_DEPTH = Rule(PICTURES, RULES["depth"].never + "|depth_to_rgb", (r"depth/image",), DEPTH_ENCODING)
REGISTERED = RULES["depth"].prefer.index(r"depth/image_rect")  # the names before it say that they are registered
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
SOURCES = ("auto", "points", "depth")  # as the segmenter's parameter of this name
COMPRESSED = re.compile(r"/(compressed|compressedDepth)$")


@dataclass(frozen=True, slots=True)
class Inputs:
    """The topic of a recording for each input of the graph; None where it has none."""

    image: str | None = None
    points: str | None = None
    depth: str | None = None
    camera_info: str | None = None
    colour_info: str | None = None  # the camera_info of `image`, where that is another than depth's
    odom: str | None = None
    imu: str | None = None
    ground_truth: str | None = None

    def chosen(self) -> dict[str, str]:
        """Input → topic, of those that there are."""
        return {f.name: topic for f in fields(self) if (topic := getattr(self, f.name)) is not None}

    @property
    def outright(self) -> dict[str, str]:
        """The remaps with which `choose_inputs` makes the same choice again: a topic for every input, "" for none."""
        return {f.name: getattr(self, f.name) or "" for f in fields(self)}

    @property
    def complete(self) -> bool:
        """Whether the graph can run on it: colour, and a depth of one kind."""
        return self.image is not None and (self.points is not None or None not in (self.depth, self.camera_info))

    @property
    def missing(self) -> str:
        """What keeps the graph from running, in words; empty if nothing does."""
        lacks = [] if self.image else ["a colour image"]
        if self.points is None and self.depth is None:
            lacks.append("points or a depth image")
        elif self.points is None and self.camera_info is None:
            lacks.append("the camera_info of the depth image (or --camera fx,fy,cx,cy)")
        return " and ".join(lacks)

    def wanted(self, source: str) -> str:
        """What is missing, for a refusal that names the segmenter's ``source`` where it narrowed the choice."""
        return self.missing + ("" if source == "auto" else f" for segmenter.source={source}")


GRAPH_TOPICS = {  # the names that the nodes subscribe to
    "image": "image",
    "points": "points",
    "depth": "depth/image",
    "camera_info": "camera_info",
    "colour_info": "colour/camera_info",
    "odom": "odom",
    "imu": "imu",
    "ground_truth": "ground_truth",
}
_INPUT_OF = {topic: name for name, topic in GRAPH_TOPICS.items()}


def choose_inputs(topics: Mapping[str, Topic], remaps: Mapping[str, str] | None = None, source: str = "auto") -> Inputs:
    """The best topic for each input. ``remaps`` say it outright: input → topic, or input → "" for none. ``source`` is
    the segmenter's: of the two kinds of depth only ``points``, only ``depth``, or the better one.

    What the nodes publish is never taken unasked: a recording may hold it too. A picture is taken for depth only where
    its name says so: a topic that fits nothing is more likely a second camera. A depth image with its camera_info goes
    before points: it is the same measurement in a thirteenth of the bytes. Points go before a depth image whose name
    does not say that it is registered to colour. ValueError for a remap that names no input, no topic of the recording,
    a topic of another type, a topic that another remap names or the kind of depth that ``source`` leaves out.
    """
    asked = _only(source, {_input_name(name): topic for name, topic in (remaps or {}).items()})
    _require_known(asked, topics)
    _require_types(asked, topics)
    _require_different(asked)
    found = _find(topics, asked)
    _fall_back(found, topics, asked)
    found["camera_info"] = asked.get("camera_info", _camera_info_of((found["depth"], found["image"]), topics))
    if _depth_wins(found, asked):
        found["points"] = None
    else:
        found["depth"] = None
        found["camera_info"] = asked.get("camera_info", _camera_info_of((found["image"], found["points"]), topics))
    found["colour_info"] = asked.get("colour_info", _colour_info_of(found, topics))
    return Inputs(**{field.name: found[field.name] or None for field in fields(Inputs)})


def _find(topics: Mapping[str, Topic], asked: Mapping[str, str]) -> dict[str, str | None]:
    """What is asked for, and the best topic for each other input, in the order of the rules; no topic serves two."""
    free = _free(topics, asked)
    found: dict[str, str | None] = {}
    for name, rule in RULES.items():
        native = name == "depth" and NATIVE in (found["image"] or "")
        found[name] = asked[name] if name in asked else _best(NATIVE_DEPTH if native else rule, free)
        free = [topic for topic in free if topic.name != found[name]]
    return found


def _free(topics: Mapping[str, Topic], asked: Mapping[str, str]) -> list[Topic]:
    """The topics that no remap names, and that were recorded of others than our own nodes."""
    taken = {*asked.values(), *DERIVED.values()}
    return [topic for topic in topics.values() if topic.name not in taken and not OWN.search(topic.name)]


def _fall_back(found: dict[str, str | None], topics: Mapping[str, Topic], asked: Mapping[str, str]) -> None:
    """Take what /tf tells, and poses as odometry, where no topic was found for an input that is not asked for."""
    for name, topic in DERIVED.items():
        if name not in asked and not found[name] and topic in topics:
            found[name] = topic
    if "odom" not in asked and not found["odom"]:
        found["odom"] = _best(POSE_ODOM, [t for t in _free(topics, asked) if t.name != found["ground_truth"]])


def _only(source: str, asked: Mapping[str, str]) -> dict[str, str]:
    """What is asked for, and of the two kinds of depth only ``source``; ValueError where the other is asked for."""
    other = {"points": "depth", "depth": "points"}.get(source)
    if other is None:
        return dict(asked)
    if asked.get(other):
        raise ValueError(
            f"remap: expected no {other} with segmenter.source={source}, got {asked[other]}; change one of the two"
        )
    return {**asked, other: ""}


def _depth_wins(found: Mapping[str, str | None], asked: Mapping[str, str]) -> bool:
    """Whether the depth image is used and not the points."""
    if not found["depth"] or not found["points"]:
        return bool(found["depth"])
    if "points" in asked or not found["camera_info"]:
        return "depth" in asked and bool(found["camera_info"])
    return "depth" in asked or NATIVE in (found["image"] or "") or _rank(RULES["depth"], found["depth"]) < REGISTERED


def parse_remaps(texts: Iterable[str]) -> dict[str, str]:
    """``image:=/camera/rgb/image_color`` and the like as a mapping; ValueError for another form."""
    remaps = {}
    for text in texts:
        name, sign, topic = text.partition(":=")
        if not sign or not name:
            raise ValueError(f"remap: expected input:=/topic, got {text!r}")
        remaps[_input_name(name)] = topic
    return remaps


def _input_name(name: str) -> str:
    plain = name.lstrip("/")
    plain = _INPUT_OF.get(plain, plain)
    if plain not in GRAPH_TOPICS:
        raise ValueError(f"remap: expected an input of {', '.join(GRAPH_TOPICS)}, got {name!r}")
    return plain


def _require_known(asked: Mapping[str, str], topics: Mapping[str, Topic]) -> None:
    unknown = sorted(topic for topic in asked.values() if topic and topic not in topics)
    if unknown:
        raise ValueError(f"remap: expected a topic of the recording ({', '.join(topics)}), got {', '.join(unknown)}")


def _require_types(asked: Mapping[str, str], topics: Mapping[str, Topic]) -> None:
    for name, topic in asked.items():
        infos = dict.fromkeys(("camera_info", "colour_info"), (CAMERA_INFO,))
        types = {**infos, "odom": POSES}.get(name) or RULES[name].types
        if topic and topics[topic].msgtype not in types:
            raise ValueError(f"expected {name} of type {' or '.join(types)}, got {topic} ({topics[topic].msgtype})")


def _require_different(asked: Mapping[str, str]) -> None:
    first: dict[str, str] = {}
    for name, topic in asked.items():
        if topic and first.setdefault(topic, name) != name:
            raise ValueError(f"remap: expected a topic of its own for {name}, got {topic} of {first[topic]} again")


def _best(rule: Rule, topics: Iterable[Topic]) -> str | None:
    fitting = [t.name for t in topics if t.msgtype in rule.types and t.count and _may_be(rule, t.name)]
    best = min(fitting, key=lambda name: (_rank(rule, name), len(name), name), default=None)
    lossless = f"{best}Depth"  # beside depth as /compressed, which is JPEG unless its driver was told otherwise
    return lossless if lossless.endswith("/compressedDepth") and lossless in fitting else best


def _may_be(rule: Rule, name: str) -> bool:
    """Whether a name is not ruled out, and fits a preference or has the proof that the others need."""
    if _fits(rule.never, name):
        return False
    return _rank(rule, name) < len(rule.prefer) or _fits(rule.proof, name)


def _fits(pattern: str, name: str) -> bool:
    """Whether a pattern is in a name; drivers do not agree on capitals either."""
    return re.search(pattern, name, re.IGNORECASE) is not None


def _rank(rule: Rule, name: str) -> int:
    base = COMPRESSED.sub("", name)
    return next((i for i, pattern in enumerate(rule.prefer) if _fits(pattern, base)), len(rule.prefer))


def _camera_info_of(pictures: Iterable[str | None], topics: Mapping[str, Topic]) -> str | None:
    """The camera_info beside the first of the pictures that has one, else the only one; the shorter name of equals."""
    infos = [t.name for t in topics.values() if t.msgtype == CAMERA_INFO and t.count and not OWN.search(t.name)]
    for picture in filter(None, pictures):
        unshared, _, nearest = min(((-_shared(info, picture), len(info), info) for info in infos), default=(0, 0, ""))
        if nearest and -unshared >= _folders(picture):
            return nearest
    return infos[0] if len(infos) == 1 else None


def _colour_info_of(found: Mapping[str, str | None], topics: Mapping[str, Topic]) -> str | None:
    """The camera_info of colour where depth is a picture with another one; None where one is of both."""
    own = _camera_info_of((found["image"],), topics) if found["depth"] else None
    return None if own == found["camera_info"] else own


def _folders(picture: str) -> int:
    """How many leading folders a camera_info must share with a picture to be of the same camera, two at most."""
    return min(2, len(COMPRESSED.sub("", picture).strip("/").split("/")) - 1)


def _shared(info: str, picture: str) -> int:
    pairs = zip(info.strip("/").split("/")[:-1], picture.strip("/").split("/"), strict=False)
    return next((i for i, (a, b) in enumerate(pairs) if a != b), len(info.strip("/").split("/")) - 1)
