# SPDX-License-Identifier: Apache-2.0
"""The launch files: what they make of their arguments, and that the nodes come up and go down with them."""

from __future__ import annotations

import json
import runpy
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import launch_ros  # noqa: F401  (the folder launch/ of the checkout would pass for launch)
import pytest
from launch.events.process import ProcessExited
from launch_ros.actions import LifecycleNode
from recording.sample_folders import tum_folder

from launch import LaunchContext

from .graph import START_S, Graph

pytestmark = pytest.mark.ros

PROGRAM = """
import sys
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
source = PythonLaunchDescriptionSource(sys.argv[1])
arguments = [tuple(word.split(":=", 1)) for word in sys.argv[2:]]
service = LaunchService()
service.include_launch_description(LaunchDescription([IncludeLaunchDescription(source, launch_arguments=arguments)]))
sys.exit(service.run())
"""


@pytest.fixture
def said(repository: Path) -> dict[str, Any]:
    """The arguments of objreg.launch.py when nothing is said."""
    file = launch_file(repository)
    return dict.fromkeys([*file["OPTIONS"], *file["TOPICS"]], "")


def launch_file(repository: Path, name: str = "objreg") -> dict[str, Any]:
    return runpy.run_path(str(repository / "launch" / f"{name}.launch.py"))


@pytest.fixture
def replayed(repository: Path, said: dict[str, Any]) -> Callable[..., list[str]]:
    """The arguments of the player behind ``replay`` for some arguments of replay.launch.py."""
    file = launch_file(repository, "replay")
    nothing = {**said, **dict.fromkeys(file["OPTIONS"], ""), "recording": "my_bag"}
    return lambda **arguments: file["_command"]({**nothing, **arguments})[4:]


def test_without_arguments_no_parameter_is_set_and_nothing_is_remapped(repository: Path, said: dict[str, Any]) -> None:
    file = launch_file(repository)
    assert file["_remappings"](said) == [] and all(file["_parameters"](node, said) == [] for node in file["NODES"])


def test_the_mapper_comes_along_when_it_is_asked_for(repository: Path, said: dict[str, Any]) -> None:
    names = launch_file(repository)["_names_of_nodes"]
    assert names(said) == ("detector", "segmenter", "registrar")
    assert names({**said, "mapper": "True"}) == ("detector", "segmenter", "registrar", "mapper")


def test_a_black_box_gets_its_seconds_and_nothing_of_the_camera(repository: Path, said: dict[str, Any]) -> None:
    parameters = launch_file(repository)["_parameters"]
    given = {**said, "blackbox": "10", "T_base_camera": "0,0,1,0,0,0,1", "reliable": "true"}
    assert parameters("blackbox", given) == [{"reliable": True, "blackbox_seconds": 10.0}]
    with pytest.raises(ValueError, match="blackbox: expected a number of seconds, got 'ten'"):
        parameters("blackbox", {**given, "blackbox": "ten"})


@pytest.mark.parametrize(("detections", "first"), [("table", "detector"), ("masks", "segmenter")])
def test_our_detector_stays_at_home_where_another_one_speaks(
    detections: str, first: str, repository: Path, said: dict[str, Any]
) -> None:
    file = launch_file(repository)
    given = {**said, "detections": detections, "camera": "500,500,320,240", "T_base_camera": "0,0,1,0,0,0,1"}
    assert file["_names_of_nodes"](given)[0] == first
    place = {"T_base_camera": [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]}
    assert file["_parameters"]("segmenter", given) == [{"detections": detections, "camera": "500,500,320,240", **place}]
    assert file["_parameters"]("registrar", given) == [place] and file["_parameters"]("detector", given) == []


def test_the_nodes_of_one_process_each_get_their_own_parameters(repository: Path, said: dict[str, Any]) -> None:
    file = launch_file(repository)
    given = {**said, "model": "my.onnx", "source": "points", "params_file": "my.yaml"}
    users, ours = file["_shared"](file["NODES"], given)
    written = json.loads(Path(ours).read_text())
    assert users == "my.yaml" and written == {
        "/**/detector": {"ros__parameters": {"model": "my.onnx"}},
        "/**/segmenter": {"ros__parameters": {"source": "points"}},
    }
    assert file["_shared"](file["NODES"], said) == []


def test_rviz_gets_the_namespace_and_the_topics_of_the_nodes(repository: Path, said: dict[str, Any]) -> None:
    rviz, made = launch_file(repository)["_rviz"], []
    rviz.__globals__.update(get_package_prefix=lambda package: "/", Node=lambda **options: made.append(options))
    alike = {"namespace": "robot", "remappings": [("/tf", "tf"), ("image", "/kinect/rgb")]}
    assert rviz(said, alike) == [] and made == []
    rviz({**said, "rviz": "true", "use_sim_time": "true"}, alike)
    (options,) = made
    assert options["arguments"] == ["-d", str(repository / "config/objreg.rviz")]
    assert {**options, **alike, "parameters": [{"use_sim_time": True}]} == options


def test_an_image_is_remapped_with_its_compressed_form(repository: Path, said: dict[str, Any]) -> None:
    rules = launch_file(repository)["_remappings"]({**said, "image": "/kinect/rgb", "depth": "/kinect/z"})
    assert rules == [
        ("image", "/kinect/rgb"),
        ("image/compressed", "/kinect/rgb/compressed"),
        ("depth/image", "/kinect/z"),
        ("depth/image/compressedDepth", "/kinect/z/compressedDepth"),
    ]


def test_the_name_of_the_camera_goes_before_its_topics_but_not_before_others(
    repository: Path, said: dict[str, Any]
) -> None:
    given = {**said, "camera_name": "front", "image": "color/image_raw", "points": "/lidar", "odom": "wheels"}
    assert launch_file(repository)["_remappings"](given) == [
        ("image", "front/color/image_raw"),
        ("image/compressed", "front/color/image_raw/compressed"),
        ("points", "/lidar"),
        ("depth/image", "front/depth/image"),
        ("depth/image/compressedDepth", "front/depth/image/compressedDepth"),
        ("camera_info", "front/camera_info"),
        ("colour/camera_info", "front/colour/camera_info"),
        ("odom", "wheels"),
        ("imu", "front/imu"),
    ]


def test_what_is_said_goes_over_the_users_file_to_the_node_that_it_is_for(
    repository: Path, said: dict[str, Any]
) -> None:
    parameters = launch_file(repository)["_parameters"]
    given = {**said, "params_file": "my.yaml", "model": "my.onnx", "reliable": "true", "source": "points"}
    assert parameters("detector", given) == ["my.yaml", {"reliable": True, "model": "my.onnx"}]
    assert parameters("segmenter", given) == ["my.yaml", {"reliable": True, "source": "points"}]
    assert parameters("registrar", given) == ["my.yaml", {"reliable": True}]


@pytest.mark.parametrize(
    ("given", "composed"),
    [({}, True), ({"composed": "false"}, False), ({"managed": "true"}, False), ({"enclaves": "/objreg"}, False),
     ({"composed": "true", "enclaves": "/objreg"}, True)],
)  # fmt: skip
def test_all_nodes_are_one_process_where_none_is_to_be_alone(
    given: dict[str, str], composed: bool, repository: Path, said: dict[str, Any]
) -> None:
    assert launch_file(repository)["_is_composed"]({**said, **given}) == composed


def test_managed_nodes_are_ones_that_launch_knows_the_state_of(repository: Path, said: dict[str, Any]) -> None:
    file = launch_file(repository)
    context = LaunchContext()
    context.launch_configurations.update({**said, "managed": "true", "autostart": "false"})
    assert [type(node) for node in file["_nodes"](context)] == [LifecycleNode] * 3
    given = {**said, "managed": "true", "autostart": "false"}
    assert file["_parameters"]("mapper", given) == [{"managed": True, "autostart": False}]


@pytest.mark.parametrize(("autostart", "expected"), [("", "active"), ("false", "unconfigured")])
def test_managed_nodes_are_launched_into_the_state_that_was_asked_for(
    graph: Graph, repository: Path, tiny_model: Path, tmp_path: Path, autostart: str, expected: str
) -> None:
    command = [sys.executable, "-c", PROGRAM, str(repository / "launch" / "objreg.launch.py"), "managed:=true"]
    with (tmp_path / "log").open("w") as log:
        launched = subprocess.Popen(
            [*command, f"namespace:=life_{expected}", f"model:={tiny_model}", f"autostart:={autostart}"],
            env={**graph.environment(), "ROS_LOG_DIR": str(tmp_path)}, cwd=repository, stdout=log, stderr=log,
        )  # fmt: skip

    def states() -> list[str]:
        statuses = [status for name, status in graph.status.items() if name.startswith(f"/life_{expected}/")]
        return [pair.value for status in statuses for pair in status.values if pair.key == "state"]

    try:
        graph.wait_for(lambda: states() == [expected] * 3, START_S, f"three nodes that are {expected}")
    finally:
        launched.send_signal(signal.SIGINT)
        launched.wait(START_S)
    said = (tmp_path / "log").read_text()
    assert said.count("process has finished cleanly") == 3 and "Traceback" not in said, said


def test_every_node_has_the_transforms_of_its_namespace(
    repository: Path, said: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    file = launch_file(repository)
    context = LaunchContext()
    context.launch_configurations.update({**said, "mapper": "true", "odom": "/wheels", "composed": "false"})
    made: list[dict[str, Any]] = []
    monkeypatch.setitem(file["_nodes"].__globals__, "Node", lambda **options: made.append(options))
    file["_nodes"](context)
    rules = [("/tf", "tf"), ("/tf_static", "tf_static"), ("odom", "/wheels")]
    assert [node["remappings"] for node in made] == [rules] * 4


def test_without_arguments_the_player_plays_as_it_is(replayed: Callable[..., list[str]]) -> None:
    assert replayed() == ["my_bag"]


def test_the_player_publishes_where_the_nodes_listen(replayed: Callable[..., list[str]]) -> None:
    rules = ["__ns:=/robot", "/tf:=tf", "/tf_static:=tf_static", "points:=/kinect/points", "odom:=/wheels"]
    arguments = replayed(namespace="robot", points="/kinect/points", odom="/wheels")
    assert arguments == ["my_bag", "--", "--ros-args", *(part for rule in rules for part in ("-r", rule))]


def test_the_player_knows_of_the_clock_and_the_depth_that_the_nodes_want(replayed: Callable[..., list[str]]) -> None:
    assert replayed(use_sim_time="true", rate="2", lossless="True", source="points") == [
        "my_bag", "--rate", "2", "--source", "points", "--lossless", "--clock",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("lossless", "reliable", "expected"),
    [("", "", ""), ("", "true", "true"), ("false", "true", "true"), ("true", "", "true"), ("true", "false", "true")],
)
def test_delivery_is_as_the_user_says_where_the_replay_is_not_lossless(
    lossless: str, reliable: str, expected: str, repository: Path
) -> None:
    context = LaunchContext()
    context.launch_configurations.update(lossless=lossless, reliable=reliable)
    for action in launch_file(repository, "replay")["_delivery"](context):
        action.visit(context)
    assert context.launch_configurations["reliable"] == expected


def test_the_nodes_of_a_launch_live_in_its_namespace_and_end_with_it(
    graph: Graph, repository: Path, tiny_model: Path, tmp_path: Path
) -> None:
    command = [sys.executable, "-c", PROGRAM, str(repository / "launch" / "objreg.launch.py")]
    with (tmp_path / "log").open("w") as log:
        launched = subprocess.Popen(
            [*command, "namespace:=robot", f"model:={tiny_model}", "use_sim_time:=false", "mapper:=true",
             "composed:=false"],
            env={**graph.environment(), "ROS_LOG_DIR": str(tmp_path)}, cwd=repository, stdout=log, stderr=log,
        )  # fmt: skip
    try:
        names = {f"/robot/{name}" for name in ("detector", "segmenter", "registrar", "mapper")}
        graph.wait_for(lambda: names <= set(graph.counters), START_S, f"diagnostics of {names}")
    finally:
        launched.send_signal(signal.SIGINT)
        launched.wait(START_S)
    said = (tmp_path / "log").read_text()
    assert said.count("process has finished cleanly") == 4, said


def test_one_process_is_launched_in_a_namespace_with_the_parameters_of_each_node(
    graph: Graph, repository: Path, tiny_model: Path, tmp_path: Path
) -> None:
    command = [sys.executable, "-c", PROGRAM, str(repository / "launch" / "objreg.launch.py")]
    passing = tmp_path / "passing"
    passing.mkdir()
    with (tmp_path / "log").open("w") as log:
        launched = subprocess.Popen(
            [*command, "namespace:=second", f"model:={tiny_model}", "mapper:=true", "respawn:=true", "log_level:=info"],
            env={**graph.environment(), "ROS_LOG_DIR": str(tmp_path), "TMPDIR": str(passing)},
            cwd=repository, stdout=log, stderr=log,
        )  # fmt: skip
    try:
        names = {f"/second/{name}" for name in ("detector", "segmenter", "registrar", "mapper")}
        graph.wait_for(lambda: names <= set(graph.counters), START_S, f"diagnostics of {names}")
        assert list(passing.glob("objreg_*.yaml"))
    finally:
        launched.send_signal(signal.SIGINT)
        launched.wait(START_S)
    assert not list(passing.glob("objreg_*.yaml"))
    said = (tmp_path / "log").read_text()
    assert said.count("process has finished cleanly") == 1 and "objreg_graph" in said and "ignored" not in said, said


def test_a_replay_brings_every_frame_through_the_nodes_and_ends_the_launch(
    graph: Graph, repository: Path, tiny_model: Path, tmp_path: Path
) -> None:
    folder = tum_folder(tmp_path / "tum", frames=5)
    launched = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(repository / "launch" / "replay.launch.py"), f"recording:={folder}",
         "lossless:=true", f"model:={tiny_model}", "camera_name:=kinect", "image:=rgb", "depth:=/kinect/z"],
        env={**graph.environment(), "ROS_LOG_DIR": str(tmp_path)}, cwd=repository, timeout=3 * START_S,
        capture_output=True, text=True,
    )  # fmt: skip
    assert "registrar: 5 published" in launched.stdout, launched.stdout + launched.stderr
    assert launched.stdout.count("process has finished cleanly") == 2


def test_each_process_runs_in_an_enclave_of_its_own_where_they_are_asked_for(
    repository: Path, said: dict[str, Any]
) -> None:
    arguments = launch_file(repository)["_ros_arguments"]
    assert arguments("detector", said) == []
    given = {**said, "enclaves": "/objreg/", "log_level": "warn"}
    assert arguments("detector", given) == ["--log-level", "warn", "--enclave", "/objreg/detector"]
    assert arguments("graph", given)[-1] == "/objreg/graph"


def test_registrar_and_keyframer_get_the_key_of_the_robots(repository: Path, said: dict[str, Any]) -> None:
    parameters, given = launch_file(repository)["_parameters"], {**said, "key_file": "fleet.key"}
    assert parameters("registrar", given) == parameters("keyframer", given) == [{"key_file": "fleet.key"}]
    assert parameters("segmenter", given) == []


@pytest.mark.parametrize("text", ["1,2,x", "1,2,3", "1,2,3,0,0,0,1,9", "nan,", ""])
def test_a_mount_that_is_no_seven_numbers_is_refused_by_its_name(repository: Path, text: str) -> None:
    with pytest.raises(ValueError, match="T_base_camera: expected seven numbers with commas"):
        launch_file(repository)["_numbers"]("T_base_camera", text)


@pytest.mark.parametrize(
    ("refused", "composed", "started"),
    [("model:=/nowhere.onnx", "false", "detector"), ("model:=/nowhere.onnx", "", "objreg_graph"),
     ("T_base_camera:=1,2,x", "", "")],
)  # fmt: skip
def test_a_launch_ends_where_something_is_refused_and_says_what(
    graph: Graph, repository: Path, tiny_model: Path, tmp_path: Path, refused: str, composed: str, started: str
) -> None:
    file = str(repository / "launch" / "objreg.launch.py")
    launched = subprocess.run(
        [sys.executable, "-c", PROGRAM, file, f"model:={tiny_model}", f"composed:={composed}", refused],
        env={**graph.environment(), "ROS_LOG_DIR": str(tmp_path)}, cwd=repository, timeout=2 * START_S,
        capture_output=True, text=True,
    )  # fmt: skip
    said = launched.stdout + launched.stderr
    assert refused.partition(":=")[2] in said and "expected" in said, said
    if started:
        assert f"{started}-1 was refused" in said and "registrar" in said, said
    else:
        assert "T_base_camera: expected seven numbers" in said and "process started" not in said, said


def test_a_node_that_was_killed_is_named_and_the_others_go_on(repository: Path) -> None:
    ended = launch_file(repository)["_ended"]
    context = LaunchContext()
    for status, lines in ((0, []), (-9, ["mapper-4 ended with status -9: the others go on without it"])):
        event = ProcessExited(returncode=status, action=None, name="mapper-4", cmd=[], cwd=None, env=None, pid=1)
        said = ["".join(part.text for part in action.msg) for action in ended(event, context)]
        assert [line.partition(";")[0] for line in said] == lines
