# SPDX-License-Identifier: Apache-2.0
"""The nodes: ``ros2 launch objreg_ros objreg.launch.py image:=/kinect/rgb points:=/kinect/points``.

Every argument is optional; ``mapper:=true`` starts the reference mapper beside the other three nodes. All of them are
one process, or with ``composed:=false`` each is one. Where another detector says what is where, ours is not started. No
parameter's default is repeated here; what is not said is as in the code. In a namespace, /tf and /tf_static are
those of the namespace.
"""

import atexit
import json
import sys
from pathlib import Path
from tempfile import NamedTemporaryFile

from ament_index_python.packages import get_package_prefix
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction, Shutdown
from launch.events.process import ProcessExited
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode, Node

from launch import LaunchContext, LaunchDescription
from objreg_ros import share
from objreg_ros.bridge.process import profile

MODULES = {"keyframer": "objreg_ros.keyframes.node", "mapper": "objreg_mapper.node"}  # others are named as their stage
NODES = ("detector", "segmenter", "registrar")

TOPICS = {
    "image": "colour image; its compressed form is looked for at <image>/compressed",
    "points": "PointCloud2, organised or not",
    "depth": "depth image, instead of points; its compressed form is looked for at <depth>/compressedDepth",
    "camera_info": "camera of the depth image",
    "colour_info": "camera of the colour image, for depth that is not registered to it",
    "odom": "odometry of the camera's body",
    "imu": "IMU of the camera",
    "detections_in": "boxes of another detector, vision_msgs/Detection2DArray",
    "masks": "picture of instances of another detector",
    "label_info": "names of the classes of another detector, vision_msgs/LabelInfo",
}
REMAPPED = {  # what the nodes listen to → the argument that says where it is, and what is added to it
    "image": ("image", ""),
    "image/compressed": ("image", "/compressed"),
    "points": ("points", ""),
    "depth/image": ("depth", ""),
    "depth/image/compressedDepth": ("depth", "/compressedDepth"),
    "camera_info": ("camera_info", ""),
    "colour/camera_info": ("colour_info", ""),
    "odom": ("odom", ""),
    "imu": ("imu", ""),
    "detections_in": ("detections_in", ""),
    "masks": ("masks", ""),
    "label_info": ("label_info", ""),
}
# The arguments that camera_name goes before.
OF_CAMERA = ("image", "points", "depth", "camera_info", "colour_info", "imu")
TF = [("/tf", "tf"), ("/tf_static", "tf_static")]  # robots in namespaces of their own have frames of the same names

OPTIONS = {
    "params_file": "YAML of parameters, in the form of config/objreg.yaml",
    "namespace": "namespace of the nodes and of their topics",
    "model": "ONNX model of the detector",
    "source": "where the segmenter takes depth from",
    "detections": "who says where objects are; with vision_msgs or masks our detector is not started",
    "camera_name": "namespace of the camera's topics, as its driver's: image, points, depth, camera_info, colour_info "
    "and imu are looked for in it, but for those that are given with a / in front",
    "camera": "the camera where nobody publishes camera_info: fx,fy,cx,cy or a calibration YAML",
    "T_base_camera": "where the camera sits on the body of odom, seven numbers with commas; else /tf_static "
    "and /tf are asked",
    "use_sim_time": "true to follow /clock",
    "reliable": "true to ask cameras for reliable delivery",
    "keyframer": "true to start a keyframer in the registrar's place, which sends keyframes to a registrar elsewhere",
    "exchange": "namespace of the topics by which registrars of several robots exchange keyframes, as /fleet",
    "key_file": "file with the key that the robots share, by which keyframes of registrar and keyframer are signed",
    "mapper": "true to start the reference mapper too, which publishes path and correction",
    "blackbox": "seconds of all inputs that a black box keeps, as 10, and writes where something goes wrong; a process "
    "of its own",
    "composed": "false for a process for each node, with 1.7 times the memory; so it is with managed or enclaves",
    "managed": "true for nodes with a life cycle (~/change_state), each a process",
    "autostart": "false to leave managed nodes unconfigured until somebody asks for more",
    "respawn": "true to start a process again that has ended with an error or was killed",
    "enclaves": "path of the nodes' enclaves under SROS 2, as /objreg: each node runs in <path>/<its name>",
    "rviz": "true to start RViz too, where it is installed",
    "log_level": "how much the nodes log",
}
SWITCHES = ("use_sim_time", "reliable", "managed", "autostart")  # that are parameters of every node
SWITCH = ("", "true", "false", "True", "False")
CHOICES = {
    "source": ("", "auto", "points", "depth"),
    "detections": ("", "auto", "table", "vision_msgs", "masks"),
    "log_level": ("", "debug", "info", "warn", "error", "fatal"),
    **dict.fromkeys((*SWITCHES, "keyframer", "mapper", "composed", "respawn", "rviz"), SWITCH),
}
FOREIGN = ("vision_msgs", "masks")  # detections that are another detector's
RESPAWN_S = 2.0
REFUSED = 1  # the status of a node that was refused at its start, with one line that says why; Python's own of a bug
POSE_NUMBERS = 7
OWN = {
    "detector": ("model",),
    "segmenter": ("source", "detections", "camera"),
    "registrar": ("exchange", "key_file"),
    "keyframer": ("key_file",),
}


def generate_launch_description() -> LaunchDescription:
    """Arguments, a line about the transport, and the nodes."""
    said = {**OPTIONS, **TOPICS}
    arguments = [
        DeclareLaunchArgument(name, default_value="", description=text, choices=CHOICES.get(name))
        for name, text in said.items()
    ]
    return LaunchDescription([*arguments, LogInfo(msg=profile.apply()), OpaqueFunction(function=_nodes)])


def _nodes(context: LaunchContext) -> list[Node]:
    said = {name: LaunchConfiguration(name).perform(context) for name in (*OPTIONS, *TOPICS)}
    names = _names_of_nodes(said)
    alike = {
        "namespace": said["namespace"],
        "remappings": [*TF, *_remappings(said)],
        "output": "screen",
        "respawn": _is_true(said["respawn"]),
        "respawn_delay": RESPAWN_S,
        "on_exit": None if _is_true(said["respawn"]) else _ended,
    }
    nodes = [_together(names, said, alike)] if _is_composed(said) else [_alone(node, said, alike) for node in names]
    if said["blackbox"]:
        nodes.append(_alone("blackbox", said, alike))
    return [*nodes, *_rviz(said, alike)]


def _is_composed(said: dict[str, str]) -> bool:
    """All in one process, unless nodes are to be apart, or each is to have a life cycle or an enclave of its own."""
    return _is_true(said["composed"]) if said["composed"] else not (_is_true(said["managed"]) or said["enclaves"])


def _alone(node: str, said: dict[str, str], alike: dict) -> Node:
    arguments = ["-m", MODULES.get(node, f"objreg_ros.{node}.node")]
    kind = LifecycleNode if _is_true(said["managed"]) else Node  # which events of a launch file around this one reach
    return kind(
        executable=sys.executable,
        arguments=arguments,
        name=node,
        exec_name=node,
        parameters=_parameters(node, said),
        ros_arguments=_ros_arguments(node, said),
        **alike,
    )


def _together(names: tuple[str, ...], said: dict[str, str], alike: dict) -> Node:
    """One process; launch names no node of it, and so a file says whose each parameter is."""
    arguments = ["-m", "objreg_tools.graph", *names]
    return Node(
        executable=sys.executable,
        arguments=arguments,
        exec_name="objreg_graph",
        parameters=_shared(names, said),
        ros_arguments=_ros_arguments("graph", said),
        **alike,
    )


def _ended(event: ProcessExited, context: LaunchContext) -> list:
    """All ends where a node was refused or has a bug: the others would wait for it. One that was killed is named."""
    if event.returncode == REFUSED:
        why = f"{event.process_name} was refused, or has a bug: the lines above say which"
        return [LogInfo(msg=f"{why}; all is ended"), Shutdown(reason=why)]
    if event.returncode and not context.is_shutdown:
        ended = f"{event.process_name} ended with status {event.returncode}: the others go on without it"
        return [LogInfo(msg=f"{ended}; with respawn:=true it is started again")]
    return []


def _ros_arguments(process: str, said: dict[str, str]) -> list[str]:
    """What the log says, and the enclave of a process."""
    level = ["--log-level", said["log_level"]] if said["log_level"] else []
    enclave = ["--enclave", f"{said['enclaves'].rstrip('/')}/{process}"] if said["enclaves"] else []
    return [*level, *enclave]


def _shared(names: tuple[str, ...], said: dict[str, str]) -> list[str]:
    """The user's file, and over it one of what was said on the command line, which goes as the launch ends."""
    values = {node: _parameters(node, {**said, "params_file": ""}) for node in names}
    owned = {f"/**/{node}": {"ros__parameters": given[0]} for node, given in values.items() if given}
    if not owned:
        return [said["params_file"]] if said["params_file"] else []
    with NamedTemporaryFile("w", prefix="objreg_", suffix=".yaml", delete=False) as file:
        json.dump(owned, file)  # which is YAML
    atexit.register(Path(file.name).unlink, missing_ok=True)  # no sooner: a node that respawns reads it again
    return [given for given in (said["params_file"], file.name) if given]


def _rviz(said: dict[str, str], alike: dict) -> list[Node]:
    """RViz where it is asked for and installed, with the nodes' namespace and topics; its own log level and end."""
    if not _is_true(said["rviz"]):
        return []
    try:
        get_package_prefix("rviz2")
    except LookupError:
        return [LogInfo(msg="rviz: expected rviz2 to be installed, got none; the nodes run without it")]
    layout = ["-d", str(share.find("config/objreg.rviz"))]
    return [
        Node(
            package="rviz2",
            executable="rviz2",
            arguments=layout,
            namespace=alike["namespace"],
            remappings=alike["remappings"],
            parameters=[{"use_sim_time": True}] if _is_true(said["use_sim_time"]) else [],
        )
    ]


def _names_of_nodes(said: dict[str, str]) -> tuple[str, ...]:
    names = tuple(node for node in NODES if node != "detector" or said["detections"] not in FOREIGN)
    if _is_true(said["keyframer"]):
        names = tuple("keyframer" if node == "registrar" else node for node in names)
    return (*names, "mapper") if _is_true(said["mapper"]) else names


def _is_true(text: str) -> bool:
    return text.lower() == "true"


def _parameters(node: str, said: dict[str, str]) -> list:
    """The user's file, and over it what was said on the command line."""
    values: dict = {name: _is_true(said[name]) for name in SWITCHES if said[name]}
    values |= {name: said[name] for name in OWN.get(node, ()) if said[name]}
    if node == "blackbox":
        values["blackbox_seconds"] = _seconds("blackbox", said["blackbox"])
    if said["T_base_camera"] and node not in ("detector", "blackbox"):
        values["T_base_camera"] = _numbers("T_base_camera", said["T_base_camera"])
    return [given for given in (said["params_file"], values) if given]


def _seconds(argument: str, text: str) -> float:
    """The number of an argument; ValueError that names it for anything else."""
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{argument}: expected a number of seconds, got {text!r}") from None


def _numbers(argument: str, text: str) -> list[float]:
    """The seven numbers of an argument; ValueError that names it for anything else."""
    try:
        numbers = [float(number) for number in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != POSE_NUMBERS:
        raise ValueError(f"{argument}: expected seven numbers with commas (x,y,z,qx,qy,qz,qw), got {text!r}")
    return numbers


def _remappings(said: dict[str, str]) -> list[tuple[str, str]]:
    """Each topic that is elsewhere than where the nodes listen, and where."""
    rules = []
    for topic, (name, ending) in REMAPPED.items():
        where = f"{said[name]}{ending}" if said[name] else topic
        if said["camera_name"] and name in OF_CAMERA and not where.startswith("/"):
            where = f"{said['camera_name'].rstrip('/')}/{where}"
        if where != topic:
            rules.append((topic, where))
    return rules
