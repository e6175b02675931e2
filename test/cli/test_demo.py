# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from recording.folders import tum_folder

from objreg_ros.cli.demo import Asked, mounting_of, run, setup_of
from objreg_ros.cli.played import as_rosbag2
from objreg_ros.recording import open_recording

ASKED = Asked(
    recording=None, model=None, labels=None, params_file=None, changes=(), remaps=(), seconds=None, rate=1.0,
    lossless=False, out=Path("out"),
)  # fmt: skip


def test_without_options_the_nodes_run_with_their_own_defaults_at_the_recordings_pace() -> None:
    setup = setup_of(ASKED)
    assert all(not arguments for arguments in setup.node_args.values()) and setup.replay_args == ["--rate", "1.0"]


def test_options_reach_the_node_that_they_are_for() -> None:
    asked = replace(ASKED, model="my.onnx", changes=("registrar.seed=4",), params_file=Path("p.yaml"))
    args = setup_of(asked).node_args
    assert args["detector"] == ["--params-file", "p.yaml", "-p", "model:=my.onnx"]
    assert args["registrar"] == ["--params-file", "p.yaml", "-p", "seed:=4"]
    assert args["segmenter"] == ["--params-file", "p.yaml"]


def test_lossless_asks_every_node_for_reliable_delivery_and_keeps_no_pace() -> None:
    setup = setup_of(replace(ASKED, lossless=True, seconds=2.0, remaps=("image:=/a",)))
    assert all("reliable:=true" in arguments for arguments in setup.node_args.values())
    assert setup.replay_args == ["--lossless", "--end", "2.0", "--remap", "image:=/a"]


def test_a_change_of_no_node_is_refused() -> None:
    with pytest.raises(ValueError, match=r"expected NODE\.NAME=VALUE"):
        setup_of(replace(ASKED, changes=("seed=4",)))


def test_the_report_learns_where_the_camera_is_on_the_body_of_the_odometry() -> None:
    changes = ("registrar.T_base_camera=[0.3,0,1.1,-0.5,0.5,-0.5,0.5]",)
    assert mounting_of(ASKED) == ()
    assert mounting_of(replace(ASKED, changes=changes)) == (0.3, 0.0, 1.1, -0.5, 0.5, -0.5, 0.5)


def test_a_folder_of_pictures_becomes_a_rosbag2_once(shared: Path, tmp_path: Path) -> None:
    kitchen = shared / "data" / "redkitchen_a"
    bag = as_rosbag2(kitchen, tmp_path, seconds=0.3)
    with open_recording(bag) as source:
        assert source.kind.startswith("rosbag2") and source.topics["/image"].count == 5
    written = (bag / "metadata.yaml").stat().st_mtime_ns
    assert as_rosbag2(kitchen, tmp_path, seconds=0.3) == bag
    assert (bag / "metadata.yaml").stat().st_mtime_ns == written
    assert as_rosbag2(bag, tmp_path, seconds=None) == bag


def test_a_recording_that_the_graph_cannot_use_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    recording = tum_folder(tmp_path / "tum")
    out = tmp_path / "out"
    with pytest.raises(ValueError, match="expected a colour image, got /"):
        run(replace(ASKED, recording=recording, remaps=("image:=",), out=out))
    assert not out.exists()
