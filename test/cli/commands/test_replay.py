# SPDX-License-Identifier: Apache-2.0
"""What `objreg replay` hands to its player; the player itself is another's test."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable
from pathlib import Path

import click
import pytest
from click.testing import CliRunner, Result
from rclpy.executors import ExternalShutdownException
from recording.sample_folders import STEP_NS, humble_bag, noetic_bag, records, robot_bag, tum_folder

from objreg_ros.bridge.streams.acknowledgements import DEPTH, IMAGE, ORDER, Acknowledgements
from objreg_ros.bridge.streams.player import PlayedMessage
from objreg_tools.cli.commands.replay import command, playable_names
from objreg_tools.recording import open_recording, write_rosbag2
from objreg_tools.recording.inputs import Inputs, choose_inputs
from objreg_tools.recording.rosbag.bags import latched_qos

KIND = "sensor_msgs/msg/Image"
PLAYED = ("image", "depth/image", "camera_info", "ground_truth")
ROBOT = {"/camera_info", "/depth/image", "/image", "/odom"}


class Stage:
    """Stands in for ROS and for the player, and records what was asked of it."""

    def __init__(self) -> None:
        self.ros_args: list[str] | None = None
        self.topics: dict[str, str] = {}
        self.latched: set[str] = set()
        self.clock = self.closed = self.shut_down = False
        self.asked: list[tuple[list[str], float]] = []
        self.deaf: list[str] = []
        self.plays: list[tuple[str, float | None, list[PlayedMessage]]] = []
        self.most = 1  # plays, and then somebody presses Ctrl-C
        self.published: Counter[str] = Counter()
        self.lost: list[int] = []

    def __call__(self, topics: dict[str, str], clock: bool, latched: Collection[str]) -> Stage:
        self.topics, self.clock, self.latched = topics, clock, set(latched)
        return self

    def init(self, args: list[str]) -> None:
        self.ros_args = args

    def try_shutdown(self) -> None:
        assert self.closed
        self.shut_down = True

    def wait_for_listeners(self, topics: Iterable[str], seconds: float) -> list[str]:
        self.asked.append((list(topics), seconds))
        return self.deaf

    def subscribe_to_acknowledgements(self, seconds: float) -> Acknowledgements:
        self.asked.append((["finished"], seconds))
        self.acknowledgements = Acknowledgements(ORDER)
        return self.acknowledgements

    def play(
        self, items: Iterable[PlayedMessage], rate: float | None, on_item: Callable[[PlayedMessage], None]
    ) -> None:
        self._take("paced", rate, items, on_item)

    def play_lossless(
        self, items: Iterable[PlayedMessage], patience: float, on_item: Callable[[PlayedMessage], None]
    ) -> None:
        self._take("lossless", patience, items, on_item)
        for item in self.plays[-1][2]:
            if item.kind == IMAGE:
                self.acknowledgements.read_acknowledgement("detector published", item.header_ns)
        self.acknowledgements.read_acknowledgement("segmenter dropped unmatched", 0)

    def _take(
        self, how: str, number: float | None, items: Iterable[PlayedMessage], on_item: Callable[[PlayedMessage], None]
    ) -> None:
        if len(self.plays) == self.most:
            raise KeyboardInterrupt
        self.plays.append((how, number, list(items)))
        for item in self.plays[-1][2]:
            self.published[item.topic] += 1
            on_item(item)

    def close(self) -> None:
        self.closed = True


@pytest.fixture
def stage(monkeypatch: pytest.MonkeyPatch) -> Stage:
    made = Stage()
    monkeypatch.setattr("objreg_ros.bridge.streams.player.Player", made)
    monkeypatch.setattr("objreg_ros.bridge.process.profile.apply", lambda: "the transport")
    monkeypatch.setattr("rclpy.init", made.init)
    monkeypatch.setattr("rclpy.try_shutdown", made.try_shutdown)
    return made


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tum_folder(tmp_path / "tum", frames=6)


def replay(folder: Path, *words: str) -> Result:
    return CliRunner().invoke(command, [str(folder), *words], catch_exceptions=False)


def test_the_inputs_go_out_under_the_names_of_the_graph_at_their_own_pace(stage: Stage, folder: Path) -> None:
    result = replay(folder)
    ((how, rate, items),) = stage.plays
    assert (how, rate, stage.clock) == ("paced", 1.0, False)
    assert stage.topics.keys() == set(PLAYED) and stage.topics["image"] == stage.topics["depth/image"] == KIND
    assert Counter(item.topic for item in items) == dict.fromkeys(PLAYED, 6)
    assert [item.stamp_ns for item in items] == sorted(item.stamp_ns for item in items)
    assert result.output.splitlines() == ["the transport", *(f"6 {topic}" for topic in sorted(PLAYED))]


def test_images_and_depths_are_distinguished_and_carry_the_stamps_of_their_headers(
    stage: Stage, tmp_path: Path
) -> None:
    replay(tum_folder(tmp_path / "late", frames=2, lag=0.004))
    played = {(item.topic, item.kind, item.header_ns) for _, _, items in stage.plays for item in items}
    assert {(IMAGE, k * STEP_NS) for k in range(2)} == {(kind, ns) for topic, kind, ns in played if topic == "image"}
    late = {(kind, ns) for topic, kind, ns in played if topic == "depth/image"}
    assert late == {(DEPTH, k * STEP_NS + 4_000_000) for k in range(2)}
    assert {(kind, ns) for topic, kind, ns in played if topic in ("camera_info", "ground_truth")} == {("", 0)}


def test_rate_clock_and_part_are_as_asked(stage: Stage, folder: Path) -> None:
    replay(folder, "--rate", "2.5", "--clock", "--start", "0.1", "--end", "0.3")
    ((_, rate, items),) = stage.plays
    assert (rate, stage.clock) == (2.5, True) and {item.stamp_ns for item in items} == {STEP_NS, 2 * STEP_NS}


def test_a_loop_plays_the_same_stamps_until_it_is_interrupted(stage: Stage, folder: Path) -> None:
    stage.most = 3
    result = replay(folder, "--loop")
    assert result.exit_code == 1 and result.output.splitlines()[1:5] == [f"18 {topic}" for topic in sorted(PLAYED)]
    first, *others = ([item.stamp_ns for item in items] for _, _, items in stage.plays)
    assert len(first) == 24 and others == [first, first] and stage.closed and stage.shut_down


def test_a_lossless_replay_keeps_no_pace_and_reports_what_became_of_every_frame(stage: Stage, folder: Path) -> None:
    stage.lost = [7, 9]
    output = replay(folder, "--lossless", "--patience", "4", "--wait", "3").output.splitlines()
    assert [play[:2] for play in stage.plays] == [("lossless", 4.0)] and stage.asked[1] == (["finished"], 3.0)
    assert output[-1].startswith("! no frame got through the registrar")
    assert output[-4:-1] == [
        "detector: 6 published",
        "segmenter: 1 dropped unmatched",
        "2 frames without an acknowledgement, the first of 7 ns",
    ]


def test_it_waits_for_who_receives_colour_and_depth_and_names_what_nobody_receives(stage: Stage, folder: Path) -> None:
    stage.deaf = ["/image"]
    result = replay(folder, "--wait", "2")
    assert stage.asked == [(["image", "depth/image"], 2.0)] and "nobody listens to /image" in result.output
    assert "next: start the nodes" in result.output
    assert stage.plays


def test_everything_goes_out_under_its_own_name(stage: Stage, folder: Path) -> None:
    replay(folder, "--all", "--remap", "ground_truth:=")
    assert set(stage.topics) == {f"/{topic}" for topic in PLAYED} and stage.asked[0][0] == ["/image", "/depth/image"]


def test_what_was_latched_goes_out_latched(stage: Stage, tmp_path: Path) -> None:
    write_rosbag2(tmp_path / "bag", records(), offered_qos={"/odom": [latched_qos(1)]})
    replay(tmp_path / "bag", "--all")
    assert stage.latched == {"/odom"} and "/image" in stage.topics
    replay(tmp_path / "bag")
    assert stage.latched == {"odom"}


def test_an_input_that_is_mapped_away_stays_home(stage: Stage, folder: Path) -> None:
    replay(folder, "--remap", "depth:=", "--remap", "odom:=")
    assert "depth/image" not in stage.topics and stage.asked[0][0] == ["image"]


def test_what_is_behind_two_dashes_goes_to_ros(stage: Stage, folder: Path) -> None:
    replay(folder, "--", "--ros-args", "-r", "__ns:=/robot")
    assert stage.ros_args == ["--ros-args", "-r", "__ns:=/robot"]


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("--start", "9"), r"expected a part of the 0\.5 s of the recording, got 9 s to the end"),
        (("--source", "points"), "expected topics that the graph can use"),
        (("--remap", "colour=/x"), "remap: expected input:=/topic, got 'colour=/x'"),
    ],
)
def test_what_cannot_be_played_is_refused_before_ros_starts(
    stage: Stage, folder: Path, words: tuple[str, ...], complaint: str
) -> None:
    away = [word for name in ("image", "camera_info", "ground_truth") for word in ("--remap", f"{name}:=")]
    with pytest.raises(ValueError, match=complaint):
        replay(folder, *words, *(away if "--source" in words else ()))
    assert stage.ros_args is None


@pytest.mark.parametrize("words", [("--rate", "0"), ("--start", "-1"), ("--patience", "-1"), ("--source", "radar")])
def test_a_number_that_cannot_be_is_refused(stage: Stage, folder: Path, words: tuple[str, str]) -> None:
    result = replay(folder, *words)
    assert result.exit_code == 2 and f"Invalid value for '{words[0]}'" in result.output and stage.ros_args is None


def test_arguments_that_ros_cannot_read_are_refused_in_one_line(folder: Path) -> None:
    with pytest.raises(ValueError, match=r"ROS arguments: expected remaps like -r __ns:=/robot.*got.*__ns=/robot"):
        replay(folder, "--", "--ros-args", "-r", "__ns=/robot")


def test_a_player_that_a_signal_ends_ends_as_if_interrupted(stage: Stage, folder: Path) -> None:
    def play(*_: object) -> None:
        stage.published["image"] = 2
        raise ExternalShutdownException

    stage.play = play  # type: ignore[method-assign]
    result = CliRunner().invoke(command, [str(folder)], standalone_mode=False)
    assert isinstance(result.exception, click.Abort | KeyboardInterrupt) and stage.closed and stage.shut_down
    assert "2 image" in result.output


def test_the_player_is_closed_and_ros_shut_down_when_a_play_fails(
    stage: Stage, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise ValueError("registrar has ended")

    monkeypatch.setattr(stage, "play", fail)
    with pytest.raises(ValueError, match="registrar has ended"):
        replay(folder)
    assert stage.closed and stage.shut_down


def test_a_topic_of_a_type_that_is_not_installed_is_left_out_by_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with open_recording(robot_bag(tmp_path / "bag")) as source:
        assert playable_names(source, choose_inputs(source.topics)) == {topic: topic for topic in ROBOT}
    assert capsys.readouterr().err == "left out: /meta (acme_msgs/msg/Meta is not installed)\n"


def test_what_ros_1_has_with_other_fields_is_left_out_by_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with open_recording(noetic_bag(tmp_path / "one.bag")) as source:
        assert set(playable_names(source, choose_inputs(source.topics))) == ROBOT
    said = capsys.readouterr().err
    assert "left out: /tf (ROS 2 does not ship tf/msg/tfMessage)" in said
    assert "left out: /arm/0 (no valid name in ROS 2)" in said
    assert "left out: /markers (visualization_msgs/msg/Marker has no texture_resource" in said


def test_what_another_ros_2_has_with_other_fields_is_left_out_by_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with open_recording(humble_bag(tmp_path / "bag")) as source:
        assert set(playable_names(source, choose_inputs(source.topics))) == {"/chatter", "/nothing"}
    assert "left out: /range (sensor_msgs/msg/Range has other fields" in capsys.readouterr().err


def test_an_input_that_cannot_be_played_is_refused(tmp_path: Path) -> None:
    with (
        open_recording(robot_bag(tmp_path / "bag")) as source,
        pytest.raises(
            ValueError, match=r"expected inputs that can be published, got /meta \(acme_msgs/msg/Meta is not"
        ),
    ):
        playable_names(source, Inputs(image="/image", points="/meta"))


def test_a_camera_that_is_given_goes_out_once_and_is_kept_for_who_comes_late(stage: Stage, folder: Path) -> None:
    replay(folder, "--camera", "100,100,63.5,47.5,128,96", "--start", "0.1")
    ((_, _, items),) = stage.plays
    assert [item.topic for item in items].count("camera_info") == 1 and items[0].topic == "camera_info"
    assert "camera_info" in stage.latched and items[0].stamp_ns == STEP_NS
