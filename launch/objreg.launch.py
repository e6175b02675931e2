# SPDX-License-Identifier: Apache-2.0
"""The nodes: ``ros2 launch objreg_ros objreg.launch.py image:=/kinect/rgb points:=/kinect/points``.

Every argument is optional; ``mapper:=true`` starts the reference mapper beside the three rooms. No parameter's default
is repeated here; what is not said is as in the code. In a namespace, /tf and /tf_static are those of the namespace.
"""

import sys

from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchContext, LaunchDescription
from objreg_ros.bridge import profile

ROOMS = ("detector", "segmenter", "registrar")

TOPICS = {
    "image": "colour image; its compressed form is looked for at <image>/compressed",
    "points": "PointCloud2, organised or not",
    "depth": "depth image, instead of points; its compressed form is looked for at <depth>/compressedDepth",
    "camera_info": "camera of the depth image",
    "odom": "odometry of the camera's body",
    "imu": "IMU of the camera",
}
REMAPPED = {  # what the nodes listen to → the argument that says where it is, and what is added to it
    "image": ("image", ""),
    "image/compressed": ("image", "/compressed"),
    "points": ("points", ""),
    "depth/image": ("depth", ""),
    "depth/image/compressedDepth": ("depth", "/compressedDepth"),
    "camera_info": ("camera_info", ""),
    "odom": ("odom", ""),
    "imu": ("imu", ""),
}
TF = [("/tf", "tf"), ("/tf_static", "tf_static")]  # robots in namespaces of their own have frames of the same names

OPTIONS = {
    "params_file": "YAML of parameters, in the form of config/objreg.yaml",
    "namespace": "namespace of the nodes and of their topics",
    "model": "ONNX model of the detector",
    "source": "where the segmenter takes depth from: auto, points or depth",
    "use_sim_time": "true to follow /clock",
    "reliable": "true to ask cameras for reliable delivery",
    "mapper": "true to start the reference mapper too, which publishes path and correction",
}


def generate_launch_description() -> LaunchDescription:
    """Arguments, a line about the transport, and the nodes."""
    said = {**OPTIONS, **TOPICS}
    arguments = [DeclareLaunchArgument(name, default_value="", description=text) for name, text in said.items()]
    return LaunchDescription([*arguments, LogInfo(msg=profile.apply()), OpaqueFunction(function=_nodes)])


def _nodes(context: LaunchContext) -> list[Node]:
    said = {name: LaunchConfiguration(name).perform(context) for name in (*OPTIONS, *TOPICS)}
    return [
        Node(
            executable=sys.executable,
            arguments=["-m", f"objreg_ros.{room}.node"],
            name=room,
            namespace=said["namespace"],
            parameters=_parameters(room, said),
            remappings=[*TF, *_remappings(said)],
            output="screen",
        )
        for room in _rooms(said)
    ]


def _rooms(said: dict[str, str]) -> tuple[str, ...]:
    return (*ROOMS, "mapper") if said["mapper"].lower() == "true" else ROOMS


def _parameters(room: str, said: dict[str, str]) -> list:
    """The user's file, and over it what was said on the command line."""
    values: dict = {name: said[name].lower() == "true" for name in ("use_sim_time", "reliable") if said[name]}
    for owner, name in (("detector", "model"), ("segmenter", "source")):
        if room == owner and said[name]:
            values[name] = said[name]
    return [given for given in (said["params_file"], values) if given]


def _remappings(said: dict[str, str]) -> list[tuple[str, str]]:
    return [(topic, f"{said[name]}{ending}") for topic, (name, ending) in REMAPPED.items() if said[name]]
