# SPDX-License-Identifier: Apache-2.0
"""The nodes on a recording: ``ros2 launch objreg_ros replay.launch.py recording:=my_bag lossless:=true``.

Every argument of objreg.launch.py is taken too: the player publishes where the nodes listen, the depth of source, and
/clock with use_sim_time; lossless asks for reliable delivery. The launch ends with the recording.
"""

import runpy
import sys
from pathlib import Path

from launch.actions import (
    DeclareLaunchArgument,
    ExecuteProcess,
    IncludeLaunchDescription,
    OpaqueFunction,
    RegisterEventHandler,
    SetLaunchConfiguration,
    Shutdown,
)
from launch.event_handlers import OnProcessExit
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration

from launch import LaunchContext, LaunchDescription

NODES_FILE = str(Path(__file__).with_name("objreg.launch.py"))
NODES = runpy.run_path(NODES_FILE)
OPTIONS = {
    "rate": "speed, 1 is that of the recording",
    "lossless": "true to wait for every frame instead of keeping the pace",
}


def generate_launch_description() -> LaunchDescription:
    """The nodes, the player, and the end of both."""
    return LaunchDescription(
        [
            DeclareLaunchArgument("recording", description="rosbag1, rosbag2 or TUM RGB-D folder"),
            *(DeclareLaunchArgument(name, default_value="", description=text) for name, text in OPTIONS.items()),
            OpaqueFunction(function=_delivery),
            IncludeLaunchDescription(PythonLaunchDescriptionSource(NODES_FILE)),
            OpaqueFunction(function=_player),
        ]
    )


def _delivery(context: LaunchContext) -> list:
    """A lossless replay needs reliable delivery; without it, delivery is as the user says."""
    lossless = _is_true(LaunchConfiguration("lossless").perform(context))
    return [SetLaunchConfiguration("reliable", "true")] if lossless else []


def _player(context: LaunchContext) -> list:
    names = ("recording", *OPTIONS, *NODES["OPTIONS"], *NODES["TOPICS"])
    said = {name: LaunchConfiguration(name).perform(context) for name in names}
    player = ExecuteProcess(cmd=_command(said), name="player", output="screen")
    return [player, RegisterEventHandler(OnProcessExit(target_action=player, on_exit=Shutdown()))]


def _command(said: dict[str, str]) -> list[str]:
    """The player as a command line."""
    command = [sys.executable, "-m", "objreg_tools.cli", "replay", said["recording"]]
    command += ["--rate", said["rate"]] if said["rate"] else []
    command += ["--source", said["source"]] if said["source"] else []
    command += ["--lossless"] if _is_true(said["lossless"]) else []
    command += ["--clock"] if _is_true(said["use_sim_time"]) else []
    rules = [("__ns", f"/{said['namespace'].strip('/')}"), *NODES["TF"]] if said["namespace"] else []
    rules += NODES["_remappings"](said)
    remaps = [text for name, topic in rules for text in ("-r", f"{name}:={topic}")]
    return [*command, "--", "--ros-args", *remaps] if remaps else command


def _is_true(text: str) -> bool:
    return text.lower() == "true"
