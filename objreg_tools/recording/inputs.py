# SPDX-License-Identifier: Apache-2.0
"""The topic of a recording for each input of the graph: of one camera and one robot, all together.

Names are ranked by `topic_rules`, and what `--remap` names wins over everything.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields

from objreg_tools.recording.camera_names import are_twins, relation, robot_of
from objreg_tools.recording.camera_sets import CameraSet, CameraSets
from objreg_tools.recording.record import Topic
from objreg_tools.recording.topic_rules import CAMERA_INFO, OWN, POSE_ODOM, POSES, RULES, Rule, candidates

TF_ODOM, TF_TRUTH = "/tf/odom", "/tf/ground_truth"  # made of the /tf of a recording, which has no topics of these names
DERIVED = {"odom": TF_ODOM, "ground_truth": TF_TRUTH}
SOURCES = ("auto", "points", "depth")  # as the segmenter's parameter of this name


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
    def outright_camera(self) -> dict[str, str]:
        """The remaps, by the names of the graph, with which `choose_inputs` takes this camera."""
        return {GRAPH_TOPICS[n]: t for n in ("image", "depth", "points") if (t := getattr(self, n)) is not None}

    @property
    def complete(self) -> bool:
        """Whether the graph can run on it: colour, and a depth of one kind."""
        return self.image is not None and (self.points is not None or None not in (self.depth, self.camera_info))

    @property
    def missing(self) -> str:
        """The obstacle that keeps the graph from running, as text; empty if none."""
        lacks = [] if self.image else ["a colour image"]
        if self.points is None and self.depth is None:
            lacks.append("points or a depth image")
        elif self.points is None and self.camera_info is None:
            lacks.append("the camera_info of the depth image (or --camera fx,fy,cx,cy)")
        return " and ".join(lacks)

    def wanted(self, source: str) -> str:
        """The missing inputs, for a refusal that names the segmenter's ``source`` where it narrowed the choice."""
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


def choose_inputs(
    topics: Mapping[str, Topic],
    remaps: Mapping[str, str] | None = None,
    source: str = "auto",
    frames: Mapping[str, str] | None = None,
) -> Inputs:
    """The best topics, of one camera and one robot. ``remaps`` say it outright: input → topic, or input → "" for none.

    ``source`` is the segmenter's: of the two kinds of depth only ``points``, only ``depth``, or the better one.
    ``frames``: topic → the frame of its first message, where that is known (`mounts.first_frames`).

    What the nodes publish is never taken unasked: a recording may hold it too. A picture is taken for depth only where
    its name says so: a topic that fits nothing is more likely a second camera. Colour and depth are of one camera, by
    their names and frames. Registered depth with its camera_info goes before points: it is the same measurement in a
    thirteenth of the bytes. Points go before a depth image of which nothing says that it is registered to colour.
    What a remap names brings the rest of its camera. Odometry of another robot than the camera's is not taken.
    ValueError for a remap that names no input, no topic of the recording, a topic of another type, a topic that another
    remap names or the kind of depth that ``source`` leaves out.
    """
    asked = _asked(topics, remaps, source)
    best = CameraSets(topics, _free(topics, asked), asked, frames).ranked()[0]
    return _whole(best, topics, asked)


def alternatives(
    topics: Mapping[str, Topic],
    frames: Mapping[str, str] | None = None,
    remaps: Mapping[str, str] | None = None,
    source: str = "auto",
) -> list[Inputs]:
    """The inputs with each other camera that could be meant, best first: what `choose_inputs` passed over.

    Only complete ones, one for each camera. With its `outright_camera` as remaps, `choose_inputs` takes it.
    """
    asked = _asked(topics, remaps, source)
    first, *others = CameraSets(topics, _free(topics, asked), asked, frames).ranked()
    kept = [first]
    for other in others:
        if other.complete and not any(_of_one_camera(other, one, frames) for one in kept):
            kept.append(other)
    return [_whole(camera, topics, asked) for camera in kept[1:]]


def depth_of_others(topics: Mapping[str, Topic], inputs: Inputs, frames: Mapping[str, str] | None = None) -> list[str]:
    """The topics of depth, best first, where none is of the camera of colour; empty where one is."""
    if inputs.image is None or inputs.depth is not None or inputs.points is not None:
        return []
    free = _free(topics, inputs.chosen())
    found = [*candidates(RULES["depth"], free), *candidates(RULES["points"], free)]
    return [] if any(relation(inputs.image, name, frames) is not None for name in found) else found


def _asked(topics: Mapping[str, Topic], remaps: Mapping[str, str] | None, source: str) -> dict[str, str]:
    """The requested topics by input; ValueError as `choose_inputs`."""
    asked = _only(source, {_input_name(name): topic for name, topic in (remaps or {}).items()})
    _require_known(asked, topics)
    _require_types(asked, topics)
    _require_different(asked)
    return asked


def _of_one_camera(one: CameraSet, other: CameraSet, frames: Mapping[str, str] | None) -> bool:
    """Whether two sets show the same camera in other topics."""
    views = [{s.image, s.depth, s.points} - {None} for s in (one, other)]
    return bool(views[0] & views[1]) or relation(one.image or "", other.image or "", frames) is not None


def _whole(camera: CameraSet, topics: Mapping[str, Topic], asked: Mapping[str, str]) -> Inputs:
    """The camera with what else there is of its robot."""
    of_camera = (camera.image, camera.depth, camera.points, camera.camera_info, camera.colour_info)
    found = dict(zip(("image", "depth", "points", "camera_info", "colour_info"), of_camera, strict=True))
    robot = robot_of(camera.image or camera.depth or camera.points or "")
    for name in ("odom", "imu", "ground_truth"):
        free = [topic for topic in _free(topics, asked) if topic.name not in found.values()]
        found[name] = asked[name] if name in asked else _of_robot(RULES[name], free, robot, topics)
    _fall_back(found, topics, asked, robot)
    return Inputs(**{field.name: found[field.name] or None for field in fields(Inputs)})


def _of_robot(rule: Rule, free: Iterable[Topic], robot: str, topics: Mapping[str, Topic]) -> str | None:
    """The best topic that a rule admits: of this robot, else of one that nothing says to be another."""
    admitted = candidates(rule, free)
    own = [name for name in admitted if robot and robot in name.strip("/").split("/")]
    open_ = [name for name in admitted if not _is_others(name, robot, topics)]
    return next(iter([*own, *open_]), None)


def _is_others(name: str, robot: str, topics: Mapping[str, Topic]) -> bool:
    return any(are_twins(robot, folder, topics) for folder in name.strip("/").split("/")[:-1])


def _free(topics: Mapping[str, Topic], asked: Mapping[str, str]) -> list[Topic]:
    """The topics that no remap names, and that were recorded of others than our own nodes."""
    taken = {*asked.values(), *DERIVED.values()}
    return [topic for topic in topics.values() if topic.name not in taken and not OWN.search(topic.name)]


def _fall_back(found: dict[str, str | None], topics: Mapping[str, Topic], asked: Mapping[str, str], robot: str) -> None:
    """Take what /tf states, and poses as odometry, where no topic was found for an input that is not asked for."""
    for name, topic in DERIVED.items():
        if name not in asked and not found[name] and topic in topics:
            found[name] = topic
    if "odom" not in asked and not found["odom"]:
        free = [t for t in _free(topics, asked) if t.name != found["ground_truth"]]
        found["odom"] = _of_robot(POSE_ODOM, free, robot, topics)


def _only(source: str, asked: Mapping[str, str]) -> dict[str, str]:
    """The requested topics, and of the two kinds of depth only ``source``; ValueError where the other is requested."""
    other = {"points": "depth", "depth": "points"}.get(source)
    if other is None:
        return dict(asked)
    if asked.get(other):
        raise ValueError(
            f"remap: expected no {other} with segmenter.source={source}, got {asked[other]}; change one of the two"
        )
    return {**asked, other: ""}


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
