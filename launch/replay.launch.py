# SPDX-License-Identifier: Apache-2.0
"""The three nodes on a recording: ``ros2 launch objreg_ros replay.launch.py recording:=my_bag lossless:=true``.

Every argument of objreg.launch.py is taken too. The launch ends with the recording.
"""

import sys
from pathlib import Path

from launch.actions import (
    DeclareLaunchArgument,
    ExecuteProcess,
    IncludeLaunchDescription,
    OpaqueFunction,
    RegisterEventHandler,
    Shutdown,
)
from launch.event_handlers import OnProcessExit
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration

from launch import LaunchContext, LaunchDescription

OPTIONS = {
    "rate": "speed, 1 is that of the recording",
    "lossless": "true to wait for every frame instead of keeping the pace",
}


def generate_launch_description() -> LaunchDescription:
    """The nodes, the player, and the end of both."""
    nodes = PythonLaunchDescriptionSource(str(Path(__file__).with_name("objreg.launch.py")))
    return LaunchDescription(
        [
            DeclareLaunchArgument("recording", description="rosbag1, rosbag2 or TUM RGB-D folder"),
            *(DeclareLaunchArgument(name, default_value="", description=text) for name, text in OPTIONS.items()),
            IncludeLaunchDescription(nodes, launch_arguments={"reliable": LaunchConfiguration("lossless")}.items()),
            OpaqueFunction(function=_player),
        ]
    )


def _player(context: LaunchContext) -> list:
    said = {name: LaunchConfiguration(name).perform(context) for name in ("recording", *OPTIONS, "namespace")}
    command = [sys.executable, "-m", "objreg_ros.cli", "replay", said["recording"]]
    command += ["--rate", said["rate"]] if said["rate"] else []
    command += ["--lossless"] if said["lossless"].lower() == "true" else []
    command += ["--", "--ros-args", "-r", f"__ns:=/{said['namespace'].strip('/')}"] if said["namespace"] else []
    player = ExecuteProcess(cmd=command, name="player", output="screen")
    return [player, RegisterEventHandler(OnProcessExit(target_action=player, on_exit=Shutdown()))]
