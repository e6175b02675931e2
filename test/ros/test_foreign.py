# SPDX-License-Identifier: Apache-2.0
"""Detectors of others: their boxes and masks make the constraints that our own detector's boxes make."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from nav_msgs.msg import Odometry as OdometryMessage
from sensor_msgs.msg import Image
from std_msgs.msg import Header, String
from std_srvs.srv import Trigger

from objreg_ros.bridge.messages import from_msg, to_msg, vision_to_msg
from objreg_ros.bridge.node import qos
from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import Odometry
from objreg_ros.data.images import Detections
from objreg_tools.cli.commands.simulate import camera_of, sensors_of
from objreg_tools.simulation.truth import SimulationTruth, TrueFrame, read_truth
from objreg_tools.simulation.write import simulate
from objreg_tools.truth import FALSE, within
from objreg_tools.truth import Truth as TruePath

from .graph import START_S, Graph
from .moments import Moment, recorded

pytestmark = pytest.mark.ros

FRAMES, RATE_HZ = 14, 2.0
STAGES = ("segmenter", "registrar")
MessagesOf = Callable[[SimulationTruth, TrueFrame], dict[str, Any]]  # a frame → messages by topic


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated round of a room that begins a second time."""
    path = tmp_path_factory.mktemp("simulated") / "recording"
    simulate(
        path, "look-alikes", 11, FRAMES, RATE_HZ, sensors=sensors_of(camera_of("qvga", None), False, (), "kinect_v1")
    )
    return path


@pytest.fixture
def fresh(domain: int, tmp_path: Path) -> Iterator[Graph]:
    made = Graph(domain, tmp_path)
    yield made
    made.close()


def true_boxes(truth: SimulationTruth, frame: TrueFrame) -> Detections:
    """What a detector without a fault says."""
    seen = [sight for sight in frame.seen if not sight.object.is_distractor]
    return Detections(
        xyxy=np.array([sight.xyxy for sight in seen], np.float32).reshape(-1, 4),
        score=np.ones(len(seen), np.float32),
        label=tuple(sight.object.label for sight in seen),
        ids=tuple(str(sight.object.instance) for sight in seen),
        image_hw=(truth.intrinsics.height, truth.intrinsics.width),
        stamp_ns=frame.stamp_ns,
    )


def names_of(truth: SimulationTruth) -> dict[int, str]:
    return dict(enumerate(sorted({one.label for objects in truth.objects for one in objects.values()})))


def as_table(truth: SimulationTruth, frame: TrueFrame) -> dict[str, Any]:
    return {"detections_table": to_msg.detections_table(true_boxes(truth, frame), names_of(truth))}


def as_vision(truth: SimulationTruth, frame: TrueFrame) -> dict[str, Any]:
    return {"detections_in": vision_to_msg.detections(true_boxes(truth, frame))}


def as_masks(truth: SimulationTruth, frame: TrueFrame) -> dict[str, Any]:
    known = [one.instance for one in truth.objects[frame.scene].values() if not one.is_distractor]
    numbers = truth.mask(frame.stamp_ns)
    numbers = np.where(np.isin(numbers, known), numbers, 0).astype("<u2")
    size = {"height": numbers.shape[0], "width": numbers.shape[1], "step": 2 * numbers.shape[1]}
    message = Image(header=to_msg.header(frame.stamp_ns, "camera"), encoding="mono16", data=numbers.tobytes(), **size)
    return {"masks": message}


def closures(graph: Graph, path: Path, messages_of: MessagesOf, **first: Any) -> list[LoopClosure]:
    """The constraints of segmenter and registrar that get a camera, odometry, and the objects of another node."""
    truth = read_truth(path)
    graph.receive(Header, "finished")
    graph.receive(OdometryMessage, "constraints", qos.latched(qos.KEPT_CONSTRAINTS))
    graph.start("segmenter", "segmenter", "-p reliable:=true")
    graph.start("registrar", "registrar", "-p reliable:=true", "-p threads:=1")
    graph.wait_for(lambda: bool(graph.connected.get("/registrar", {}).get("/objects")), START_S, "the nodes to connect")
    for topic, message in first.items():
        graph.publish(topic, message)
    for moment in recorded(path, FRAMES, step=1):
        frame = truth.frame(moment.stamp_ns)
        assert frame is not None
        feed(graph, moment, {**messages_of(truth, frame), "odom": odometry(frame)})
        assert [graph.answer(stage, moment.stamp_ns) for stage in STAGES] == ["published"] * 2, graph.log("segmenter")
    client = graph.node.create_client(Trigger, "registrar/save")
    graph.wait_for(client.service_is_ready, START_S, "the registrar's service")
    saved = client.call_async(Trigger.Request())
    graph.wait_for(saved.done, START_S, "the last keyframe")
    return [from_msg.loop_closure(message) for message in graph.received["constraints"]]


def odometry(frame: TrueFrame) -> OdometryMessage:
    return to_msg.odometry(Odometry(T_odom_body=frame.T_world_camera, stamp_ns=frame.stamp_ns, frame_id="odom"))


def feed(graph: Graph, moment: Moment, more: dict[str, Any]) -> None:
    for topic, message in {**more, **moment.messages}.items():
        graph.publish(topic, message)


def false_ones(path: Path, found: list[LoopClosure]) -> list[LoopClosure]:
    truth = TruePath((frame.stamp_ns, frame.T_world_camera) for frame in read_truth(path).frames)
    return [one for one in found if (error := truth.error(one)) is None or not within(error, FALSE)]


def test_masks_of_anyone_make_true_constraints(fresh: Graph, simulated: Path) -> None:
    found = closures(fresh, simulated, as_masks)
    assert found and not false_ones(simulated, found)


@pytest.mark.skipif(vision_to_msg.Detection2DArray is None, reason="vision_msgs is not installed")
def test_boxes_of_anyone_make_the_constraints_of_our_own_table(domain: int, tmp_path: Path, simulated: Path) -> None:
    found: dict[str, list[LoopClosure]] = {}
    labels = {"labels": to_msg.labels(names_of(read_truth(simulated)))}
    for name, messages_of, first in (("table", as_table, labels), ("vision", as_vision, {})):
        (tmp_path / name).mkdir()
        graph = Graph(domain, tmp_path / name)
        try:
            found[name] = closures(graph, simulated, messages_of, **first)
        finally:
            graph.close()
    ends = {name: [(one.from_ns, one.to_ns) for one in of] for name, of in found.items()}
    assert ends["table"] and ends["vision"] == ends["table"] and not false_ones(simulated, found["vision"])
    for ours, theirs in zip(found["table"], found["vision"], strict=True):
        assert np.allclose(ours.T_from_to, theirs.T_from_to, atol=1e-6)


@pytest.mark.skipif(vision_to_msg.Detection2DArray is None, reason="vision_msgs is not installed")
def test_names_of_masks_are_known_to_everybody_before_their_objects_are(fresh: Graph, simulated: Path) -> None:
    from vision_msgs.msg import Detection3DArray, LabelInfo, VisionClass

    objects = read_truth(simulated).objects[0].values()
    label_info = LabelInfo(class_map=[VisionClass(class_id=one.instance, class_name=one.label) for one in objects])
    fresh.receive(String, "labels", qos.latched())
    fresh.receive(Detection3DArray, "detections_3d")
    closures(fresh, simulated, as_masks, label_info=label_info)
    names = set(from_msg.labels(fresh.received["labels"][-1]).values())
    assert names and names <= {one.label for one in objects}
    fresh.wait_for(lambda: len(fresh.received["detections_3d"]) == FRAMES, what="solids")
    solids = [one for message in fresh.received["detections_3d"] for one in message.detections]
    shown = {one.results[0].hypothesis.class_id for one in solids} - {"thing"}
    assert shown and shown <= names
