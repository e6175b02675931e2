# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
import sys
from dataclasses import replace
from itertools import permutations
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from recording.sample_folders import CAMERA, records, tum_folder, uncalibrated

from objreg_tools.cli.commands.demo import (
    DemoOptions,
    _draw,
    begun_summary,
    calibrated,
    camera_asked,
    camera_of,
    mounting_of,
    run,
    setup_of,
)
from objreg_tools.recording import open_recording, write_rosbag2
from objreg_tools.recording.inputs import Inputs, parse_remaps
from objreg_tools.truth import Truth

ASKED = DemoOptions(
    recording=None, model=None, labels=None, params_file=None, changes=(), remaps=(), seconds=None, rate=1.0,
    lossless=False, out=Path("out"),
)  # fmt: skip
INPUTS = Inputs(image="/a", depth="/d", camera_info="/i", odom="/o")


def test_a_simulated_room_has_its_calibration_and_its_model_unless_something_else_is_asked_for() -> None:
    camera, model = "registrar.covariance_calibration=0.01", "detector.model=objreg_ssd.onnx"
    assert calibrated(ASKED).changes == (camera, model)
    assert calibrated(replace(ASKED, model="my.onnx")).changes == (camera,)
    own = ("registrar.covariance_calibration=0.02",)
    assert calibrated(replace(ASKED, changes=own)).changes == (model, *own)
    assert calibrated(replace(ASKED, params_file=Path("own.yaml"))).changes == ()


def test_without_options_the_nodes_run_with_their_own_defaults_at_the_recordings_pace() -> None:
    setup = setup_of(ASKED, INPUTS)
    assert all(not arguments for arguments in setup.node_args.values()) and setup.replay_args[:2] == ["--rate", "1.0"]


def test_options_reach_the_node_that_they_are_for() -> None:
    asked = replace(ASKED, model="my.onnx", changes=("registrar.seed=4",), params_file=Path("p.yaml"))
    args = setup_of(asked, INPUTS).node_args
    assert args["detector"] == ["--params-file", "p.yaml", "-p", 'model:="my.onnx"', "-p", 'detector:model:="my.onnx"']
    assert args["registrar"] == ["--params-file", "p.yaml", "-p", "seed:=4", "-p", "registrar:seed:=4"]
    assert args["segmenter"] == ["--params-file", "p.yaml"]


def test_lossless_asks_every_node_for_reliable_delivery_and_keeps_no_pace() -> None:
    setup = setup_of(replace(ASKED, lossless=True, seconds=2.0), INPUTS)
    assert all(f"{node}:reliable:=true" in arguments for node, arguments in setup.node_args.items())
    assert setup.replay_args[:3] == ["--lossless", "--end", "2.0"]


def test_the_player_plays_just_the_inputs_that_were_chosen() -> None:
    words = setup_of(ASKED, INPUTS).replay_args[2:]
    assert set(words[::2]) == {"--remap"} and parse_remaps(words[1::2]) == INPUTS.outright


def test_a_change_reaches_its_node_in_its_type() -> None:
    changes = ("registrar.T_base_camera=0,0,0.1,0,0,0,1", "registrar.label_groups=cup mouse,tv", "registrar.store=123")
    assert setup_of(replace(ASKED, changes=changes), INPUTS).node_args["registrar"][3::4] == [
        "registrar:T_base_camera:=[0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0]",
        'registrar:label_groups:=["cup mouse", "tv"]',
        'registrar:store:="123"',
    ]


@pytest.mark.ros
@pytest.mark.parametrize("titles", list(permutations(("/**", "/**/detector", "detector"), 2)))
def test_a_change_wins_over_every_section_of_the_parameter_file(titles: tuple[str, ...], tmp_path: Path) -> None:
    pytest.importorskip("rclpy", reason="ROS 2 is not installed")
    from rclpy.context import Context
    from rclpy.node import Node

    file = tmp_path / "p.yaml"
    file.write_text("".join(f"{title}:\n  ros__parameters: {{threshold: 0.3, model: a}}\n" for title in titles))
    asked = replace(ASKED, params_file=file, changes=("detector.threshold=0.9",), model="my.onnx", lossless=True)
    context = Context()
    context.init(args=["--ros-args", *setup_of(asked, INPUTS).node_args["detector"]])
    node = Node("detector", context=context, start_parameter_services=False)
    declared = (
        node.declare_parameter(name, value) for name, value in (("threshold", 0.5), ("model", ""), ("reliable", False))
    )
    assert [parameter.value for parameter in declared] == [0.9, "my.onnx", True]
    node.destroy_node()
    context.try_shutdown()


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (
            "seed=4",
            r"expected node\.parameter=value with a node of detector, segmenter, registrar, .*, got 'seed=4'",
        ),
        ("mapper.map_frame=m", r"expected a node of the demo \(detector, segmenter, registrar\), got mapper"),
    ],
)
def test_a_change_of_no_node_of_the_demo_is_refused(change: str, complaint: str) -> None:
    with pytest.raises(ValueError, match=f"--set: {complaint}"):
        setup_of(replace(ASKED, changes=(change,)), INPUTS)


def test_the_report_learns_where_the_camera_is_on_the_body_of_the_odometry() -> None:
    changes = ("registrar.T_base_camera=[0.3,0,1.1,-0.5,0.5,-0.5,0.5]",)
    assert mounting_of(ASKED) == ()
    assert mounting_of(replace(ASKED, changes=changes)) == (0.3, 0.0, 1.1, -0.5, 0.5, -0.5, 0.5)


def test_a_demo_plays_the_depth_that_its_segmenter_takes(tmp_path: Path) -> None:
    asked = replace(ASKED, recording=tum_folder(tmp_path / "tum"), changes=("segmenter.source=points",))
    with pytest.raises(ValueError, match=r"expected points or a depth image for segmenter\.source=points, got /"):
        run(replace(asked, out=tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_a_camera_that_is_not_calibrated_is_no_camera_to_draw_with(tmp_path: Path) -> None:
    inputs = Inputs(image="/image", points="/points", camera_info="/camera_info")
    for name, info, fx in (("known", next(records()), CAMERA.fx), ("unknown", uncalibrated(5), None)):
        write_rosbag2(tmp_path / name, [info])
        with open_recording(tmp_path / name) as source:
            assert getattr(camera_of(source, inputs), "fx", None) == fx
            assert camera_of(source, replace(inputs, camera_info=None)) is None


def test_a_recording_that_the_graph_cannot_use_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    recording = tum_folder(tmp_path / "tum")
    out = tmp_path / "out"
    with pytest.raises(ValueError, match="expected a colour image, got /"):
        run(replace(ASKED, recording=recording, remaps=("image:=",), out=out))
    assert not out.exists()


def test_a_picture_that_needs_what_is_not_installed_is_left_out_and_the_demo_says_what_brings_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    live: Any = SimpleNamespace(sight=None, closures=[])
    source: Any = None  # nothing is read of it where there is no camera_info
    _draw(tmp_path, live, Truth([(0, np.eye(4)), (1, np.eye(4))]), source, Inputs(image="/a"))
    (line,) = capsys.readouterr().err.splitlines()
    assert "did not draw" in line and "pip install 'objreg_ros[report]'" in line


def test_a_camera_that_is_given_reaches_the_player_by_its_option_or_by_the_segmenters_parameter() -> None:
    assert camera_asked(replace(ASKED, camera="5,5,2,1")) == "5,5,2,1" and camera_asked(ASKED) == ""
    assert camera_asked(replace(ASKED, changes=("segmenter.camera=6,6,2,1",))) == "6,6,2,1"
    assert setup_of(ASKED, INPUTS, "5,5,2,1").replay_args[2:4] == ["--camera", "5,5,2,1"]


@pytest.mark.parametrize("place", ["bag", "bag/bag.mcap"])
def test_the_report_learns_how_the_run_was_made(place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["objreg", "demo", "my room"])
    write_rosbag2(tmp_path / "bag", records())
    asked = replace(ASKED, model="objreg_ssd.onnx", changes=("detector.threshold=0.4",))
    with open_recording(tmp_path / place) as source:
        summary = begun_summary(asked, tmp_path / "my room", source, INPUTS)
    assert summary["recording"] == str(tmp_path / place) and summary["name"] == "my room, live"
    assert summary["about"]["command"] == "objreg demo 'my room'" and summary["about"]["recording"].endswith("/my room")
    assert (
        summary["about"]["params"] == {"detector.threshold": 0.4}
        and summary["about"]["model"]["name"] == summary["model"]
    )
    json.dumps(summary)
