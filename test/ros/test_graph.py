# SPDX-License-Identifier: Apache-2.0
"""All nodes in one process: what goes through it, what it publishes, and how it begins and ends."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from detector.discs import instances, require_objects, save_disc_model
from nav_msgs.msg import Odometry
from recording.sample_folders import CAMERA, tum_folder
from sensor_msgs.msg import PointCloud2

from objreg_ros.bridge.messages import from_msg
from objreg_ros.bridge.node import qos

from .graph import START_S, Graph
from .test_replay import await_release, end_keyframe, objreg, start

pytestmark = pytest.mark.ros
STAGES = ("detector", "segmenter", "registrar")
LOSSLESS = ("--lossless", "--wait", str(START_S), "--patience", "60")


@pytest.fixture
def fresh(domain: int, tmp_path: Path) -> Iterator[Graph]:
    made = Graph(domain, tmp_path)
    yield made
    made.close()


def compose(graph: Graph, model: Path, *more: str) -> None:
    parameters = (f"detector:model:={model}", "reliable:=true", *more)
    graph.start_composed("--ros-args", *(part for parameter in parameters for part in ("-p", parameter)))


def test_a_lossless_replay_brings_every_frame_through_one_process(
    fresh: Graph, tiny_model: Path, tmp_path: Path
) -> None:
    compose(fresh, tiny_model)
    folder = tum_folder(tmp_path / "tum", frames=12)
    output = objreg(fresh, "replay", str(folder), *LOSSLESS)
    for stage in STAGES:
        assert f"{stage}: 12 published\n" in output
        counters = fresh.balance(f"/{stage}", received=12)
        assert (counters.published, counters.dropped, counters.lost) == (12, {}, {})
    assert fresh.stop("graph") == 0


def test_pictures_that_the_highest_rate_leaves_out_are_handed_on_as_surplus_whatever_the_stamps_of_depth(
    fresh: Graph, tiny_model: Path, tmp_path: Path
) -> None:
    compose(fresh, tiny_model, "detector:max_rate:=5.0")
    output = objreg(fresh, "replay", str(tum_folder(tmp_path / "tum", frames=12, lag=0.004)), *LOSSLESS)
    assert "registrar: 6 published\n" in output
    assert "detector: 6 dropped surplus, 6 published\n" in output


def test_who_listens_from_outside_receives_what_the_nodes_publish(
    fresh: Graph, tiny_model: Path, tmp_path: Path
) -> None:
    topics = "detections_table", "objects", "view"
    for topic in topics:
        fresh.receive(PointCloud2, topic)
    compose(fresh, tiny_model)
    objreg(fresh, "replay", str(tum_folder(tmp_path / "tum", frames=3)), *LOSSLESS)
    for topic in topics:
        fresh.wait_for(lambda: len(fresh.received[topic]) == 3, what=topic)  # noqa: B023


@pytest.mark.parametrize("composed", [False, True], ids=["three", "one"])
def test_the_masks_of_our_detector_cut_the_objects_in_three_processes_and_in_one(
    composed: bool, fresh: Graph, tmp_path: Path
) -> None:
    model = save_disc_model(tmp_path / "discs.onnx", (CAMERA.height, CAMERA.width))
    fresh.receive(PointCloud2, "objects")
    fresh.receive(PointCloud2, "detections_table")
    (compose if composed else start)(fresh, model)
    objreg(fresh, "replay", str(tum_folder(tmp_path / "tum", frames=3)), *LOSSLESS)
    fresh.wait_for(lambda: all(len(fresh.received[name]) == 3 for name in ("objects", "detections_table")), what="all")
    names = {0: "cup", 1: "pot", 2: "book"}
    expected, known = instances((CAMERA.height, CAMERA.width))
    for objects, table in zip(fresh.received["objects"], fresh.received["detections_table"], strict=True):
        require_objects(CAMERA, from_msg.objects(objects, names)[0])
        found = from_msg.detections(table, names).instances
        assert found is not None and np.array_equal(found[known], expected[known])


def test_a_node_that_is_refused_ends_the_process_with_one_line(fresh: Graph, tmp_path: Path) -> None:
    fresh.start_composed("--ros-args", "-p", "detector:model:=nowhere.onnx")
    process = fresh.processes.pop("graph")
    assert process.wait(START_S) == 1
    assert "nowhere.onnx" in fresh.log("graph") and "Traceback" not in fresh.log("graph")


@pytest.mark.slow
def test_one_process_gives_the_constraints_of_three(fresh: Graph, shared: Path) -> None:
    kitchen, model = shared / "data/redkitchen_a", shared / "models/ssd_mobilenet_v1_coco_int8.onnx"
    words = "replay", str(kitchen), "--lossless", "--end", "3.6", "--wait", str(START_S)
    fresh.receive(Odometry, "constraints", qos.latched(qos.KEPT_CONSTRAINTS))
    found = []
    for composed in (False, True):
        if composed:
            compose(fresh, model, "detector:threshold:=0.4")
        else:
            start(fresh, model, "-p threshold:=0.4")
        objreg(fresh, *words)
        end_keyframe(fresh)
        await_release(fresh)
        found.append(list(map(from_msg.loop_closure, fresh.received["constraints"])))
        fresh.received["constraints"].clear()
        for name in list(fresh.processes):
            assert fresh.stop(name, signal.SIGTERM) == 0
    three, one = found
    assert three and [(c.from_ns, c.to_ns) for c in one] == [(c.from_ns, c.to_ns) for c in three]
    for mine, theirs in zip(one, three, strict=True):
        assert np.allclose(mine.T_from_to, theirs.T_from_to, atol=1e-9)
        assert np.allclose(mine.covariance, theirs.covariance, rtol=1e-9)
