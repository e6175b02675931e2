# SPDX-License-Identifier: Apache-2.0
"""`objreg replay` into the three nodes, each a process."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from recording.sample_folders import robot_bag, tum_folder
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image
from std_srvs.srv import Trigger

from objreg_ros.bridge.messages import closures_msg, from_msg, headers
from objreg_ros.bridge.node import qos
from objreg_ros.bridge.node.diagnostics import refusal_of

from .graph import START_S, Graph

pytestmark = pytest.mark.ros
STAGES = ("detector", "segmenter", "registrar")
QUIET_S = 1.0  # without another message


def objreg(graph: Graph, *arguments: str, seconds: float = 600) -> str:
    """The output of the command, while messages come in."""
    command = [sys.executable, "-m", "objreg_tools.cli", *arguments]
    with subprocess.Popen(command, env=graph.environment(), stdout=subprocess.PIPE, text=True) as process:
        graph.wait_for(lambda: process.poll() is not None, seconds, " ".join(arguments))
        assert process.stdout is not None
        output = process.stdout.read()
    assert process.returncode == 0, output
    return output


def start(graph: Graph, model: Path, *detector: str) -> None:
    graph.start("detector", "detector", f"-p model:={model}", "-p reliable:=true", *detector)
    graph.start("segmenter", "segmenter", "-p reliable:=true")
    graph.start("registrar", "registrar")


@pytest.fixture
def fresh(domain: int, tmp_path: Path) -> Iterator[Graph]:
    made = Graph(domain, tmp_path)
    yield made
    made.close()


def test_a_lossless_replay_brings_every_frame_through_every_node(
    fresh: Graph, tiny_model: Path, tmp_path: Path
) -> None:
    start(fresh, tiny_model)
    folder = tum_folder(tmp_path / "tum", frames=12)
    output = objreg(fresh, "replay", str(folder), "--lossless", "--wait", str(START_S), "--patience", "60")
    assert "12 image" in output
    for stage in STAGES:
        assert f"{stage}: 12 published\n" in output
        counters = fresh.balance(f"/{stage}", received=12)
        assert (counters.published, counters.dropped, counters.lost) == (12, {}, {})


@pytest.mark.parametrize("lag", [0.0, 0.004])
def test_a_lossless_replay_of_a_camera_that_is_too_fast_ends_with_a_surplus(
    lag: float, fresh: Graph, tiny_model: Path, tmp_path: Path
) -> None:
    start(fresh, tiny_model, "-p max_rate:=5.0")
    folder = tum_folder(tmp_path / "tum", frames=12, lag=lag)
    output = objreg(fresh, "replay", str(folder), "--lossless", "--wait", str(START_S), "--patience", "60")
    assert "registrar: 6 published\n" in output
    assert "detector: 6 dropped surplus, 6 published\n" in output
    assert fresh.balance("/detector", received=12).dropped == {"surplus": 6}
    assert "surplus" not in fresh.log("detector") + fresh.log("segmenter")  # which would be a warning


def test_depth_with_stamps_of_its_own_goes_through_but_for_the_last(
    fresh: Graph, tiny_model: Path, tmp_path: Path
) -> None:
    start(fresh, tiny_model)
    folder = tum_folder(tmp_path / "tum", frames=6, lag=0.004)
    output = objreg(fresh, "replay", str(folder), "--lossless", "--wait", str(START_S), "--patience", "60")
    if "registrar: 6 published\n" not in output:  # where the silence of a busy machine lets the last one go, too
        assert "registrar: 5 published\n" in output  # the last depth is newer than any image, so another may come
        assert "1 frames without an acknowledgement, the first of 504000000 ns" in output


def test_a_paced_replay_keeps_its_rate_and_publishes_the_time(fresh: Graph, tmp_path: Path) -> None:
    fresh.receive(Clock, "/clock")
    fresh.receive(Image, "image")
    fresh.receive(Image, "depth/image")
    folder = tum_folder(tmp_path / "tum", frames=11)
    output = objreg(fresh, "replay", str(folder), "--clock", "--rate", "2", "--start", "0.2", "--wait", str(START_S))
    assert "9 image" in output and "9 depth/image" in output
    times = [headers.stamp_ns(m.clock) for m in fresh.received["/clock"]]
    assert times == sorted(times) and times[-1] == 10**9


def test_everything_is_played_but_for_types_that_are_not_installed(fresh: Graph, tmp_path: Path) -> None:
    bag = robot_bag(tmp_path / "bag")
    fresh.receive(Odometry, "/odom")
    output = objreg(fresh, "replay", str(bag), "--all", "--wait", "0")
    assert "3 /odom\n" in output and "/meta" not in output


def test_a_lossless_replay_without_nodes_says_so(fresh: Graph, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "objreg_tools.cli", "replay", str(tum_folder(tmp_path / "tum")), "--lossless"]
    done = subprocess.run([*command, "--wait", "0"], env=fresh.environment(), capture_output=True, text=True)
    assert done.returncode == 1 and "expected the nodes to publish `finished`, got none" in done.stderr


@pytest.mark.parametrize(("how", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_replay_that_is_asked_to_end_does_so_with_the_usual_status(
    how: signal.Signals, status: int, fresh: Graph, tmp_path: Path
) -> None:
    words = ["replay", str(tum_folder(tmp_path / "tum")), "--loop", "--wait", "0"]
    command = [sys.executable, "-m", "objreg_tools.cli", *words]
    with subprocess.Popen(command, env=fresh.environment(), stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        while "nobody listens to /depth/image" not in process.stderr.readline():  # then it plays
            assert process.poll() is None
        process.send_signal(how)
        _, said = process.communicate(timeout=60)
    ours = said.partition("Exception ignored in: <function tqdm")[0]  # which Ubuntu's version says of a half-made bar
    assert process.returncode == status and "Traceback" not in ours, said


def end_keyframe(graph: Graph) -> None:
    """Let the registrar search for the keyframe in hand, as an offline run does at its end."""
    client = graph.node.create_client(Trigger, "registrar/save")
    graph.wait_for(client.service_is_ready, what="the registrar's service")
    answer = client.call_async(Trigger.Request())
    graph.wait_for(answer.done, START_S, "the registrar to save")


def await_release(graph: Graph, constraints: int = 1) -> None:
    """Let the registrar publish what waited for its camera to be believed, as it does once no frame comes."""
    published = graph.received["constraints"]
    graph.wait_for(lambda: len(published) >= constraints, START_S, "constraints of a camera that is silent")
    ends, count = time.monotonic() + QUIET_S, len(published)
    graph.wait_for(lambda: len(published) != count or time.monotonic() > ends)
    if len(published) != count:
        await_release(graph, len(published))


@pytest.mark.slow
def test_a_recording_gives_the_same_constraints_live_and_offline(fresh: Graph, shared: Path, tmp_path: Path) -> None:
    kitchen, model = shared / "data/redkitchen_a", shared / "models/ssd_mobilenet_v1_coco_int8.onnx"
    fresh.receive(Odometry, "constraints", qos.latched(qos.KEPT_CONSTRAINTS))
    start(fresh, model, "-p threshold:=0.4")
    objreg(fresh, "replay", str(kitchen), "--lossless", "--end", "4", "--wait", str(START_S))
    end_keyframe(fresh)
    words = ("offline", str(kitchen), "--model", str(model), "--set", "detector.threshold=0.4", "--max-frames", "60")
    objreg(fresh, *words, "--json", str(tmp_path / "out.json"))
    offline = json.loads((tmp_path / "out.json").read_text())["constraints"]
    expected = [(c["from_ns"], c["to_ns"]) for c in offline]
    fresh.wait_for(lambda: len(fresh.received["constraints"]) >= len(expected), what="the constraints of the replay")
    live = [from_msg.loop_closure(message) for message in fresh.received["constraints"]]
    assert expected and [(c.from_ns, c.to_ns) for c in live] == expected
    for mine, theirs in zip(live, offline, strict=True):
        assert np.allclose(mine.T_from_to, theirs["T_from_to"], atol=1e-9)
        assert np.allclose(mine.covariance, theirs["covariance"], rtol=1e-9)


@pytest.mark.slow
def test_objreg_msgs_state_the_same_as_the_topics_of_common_interfaces_and_more(fresh: Graph, shared: Path) -> None:
    if closures_msg.LoopClosureMsg is None:
        pytest.skip("objreg_msgs is not installed: colcon builds it from this repository")
    kitchen, model = shared / "data/redkitchen_a", shared / "models/ssd_mobilenet_v1_coco_int8.onnx"
    kept = qos.latched(qos.KEPT_CONSTRAINTS)
    fresh.receive(Odometry, "constraints", kept)
    fresh.receive(DiagnosticArray, "refusals")
    fresh.receive(closures_msg.Refusal, "closure_refusals")
    fresh.receive(closures_msg.ObjectLandmarks, "object_landmarks")
    start(fresh, model, "-p threshold:=0.4")
    objreg(fresh, "replay", str(kitchen), "--lossless", "--end", "4", "--wait", str(START_S))
    end_keyframe(fresh)
    fresh.receive(closures_msg.LoopClosureMsg, "loop_closures", kept)  # it comes late
    constraints = [from_msg.loop_closure(message) for message in fresh.received["constraints"]]
    messages = fresh.received["loop_closures"]
    fresh.wait_for(lambda: len(messages) == len(constraints) > 0, what="the closures that were kept")
    assert len({message.id for message in messages}) == len(messages)
    for mine, theirs in zip(map(closures_msg.read_loop_closure, messages), constraints, strict=True):
        assert (mine.from_ns, mine.to_ns) == (theirs.from_ns, theirs.to_ns)
        assert (mine.from_frame_id, mine.to_frame_id) == (theirs.from_frame_id, theirs.to_frame_id)
        assert np.array_equal(mine.T_from_to, theirs.T_from_to) and np.array_equal(mine.covariance, theirs.covariance)
        assert mine.evidence["odds"] > 1 and mine.objects and (mine.from_session, mine.to_session) == (0, 0)
    refusals = [refusal_of(status) for message in fresh.received["refusals"] for status in message.status]
    whole = [closures_msg.read_refusal(message) for message in fresh.received["closure_refusals"]]
    assert [(w.reason, w.to_ns, w.detail) for w in whole] == [(r.reason, r.to_ns, r.detail) for r in refusals]
    assert fresh.received["object_landmarks"][0].session == "0" and fresh.received["object_landmarks"][0].landmarks
