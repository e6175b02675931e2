# SPDX-License-Identifier: Apache-2.0
"""What a collector makes of the messages of a graph; they are handed to its subscriptions, without any graph."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.context import Context
from std_srvs.srv import Trigger

from objreg_ros.bridge.messages import to_msg
from objreg_ros.bridge.node.accounting import Balance
from objreg_ros.bridge.node.common import CommonDiagnostics
from objreg_ros.bridge.node.diagnostics import diagnostic, refusals
from objreg_ros.bridge.streams import collector as collector_module
from objreg_ros.bridge.streams.collector import Collector
from objreg_ros.data.closures import LoopClosure, Reason, Rejected
from objreg_ros.data.frames import Frame, ObjectCloud, View
from objreg_ros.data.images import Detections, Intrinsics
from objreg_ros.diagnostics import Diagnostics
from objreg_ros.registrar.diagnostics import RegistrarDiagnostics

NAMES = {0: "cup", 7: "tv"}
REGISTRAR = RegistrarDiagnostics(
    keyframes=5, objects=9, landmarks=4, sessions=1, closures=0, unsearched=0, forgotten=0, waiting_keyframes=0,
    waiting_poses=0, without_odometry=0, constraints=0, confirmed=0, rejected={"no_candidate": 3}, vetoed=0,
    localisation="", withdrawn=0,
)  # fmt: skip
BALANCE = Balance(10, 6, 1, {"overtaken": 3}, {"image": 2}, {"total": (10.0, 20.0)})


@pytest.fixture(params=[None])
def collector(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> Iterator[Collector]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    context = Context()
    context.init(args=[])
    made = Collector(context, request.param)
    yield made
    made.close()
    context.try_shutdown()


def receive(collector: Collector, topic: str, message: Any) -> None:
    """Hand a message to the subscription of a topic, as ROS does."""
    (subscription,) = (s for s in collector.subscriptions if s.topic_name == topic)
    assert isinstance(message, subscription.msg_type)
    subscription.callback(message)


def detections(stamp_ns: int, *labels: str) -> Any:
    count = len(labels)
    xyxy = np.tile(np.array([[1, 2, 30, 40]], np.float32), (count, 1))
    found = Detections(
        xyxy=xyxy, score=np.full(count, 0.5, np.float32), label=labels, image_hw=(480, 640), stamp_ns=stamp_ns
    )
    return to_msg.detections_table(found, NAMES)


def frame(stamp_ns: int, *labels: str) -> Frame:
    """A frame of objects; the k-th has its points about (k, 0, 2) and one stray."""
    clouds = []
    for k, label in enumerate(labels, start=1):
        xyz = np.array([[k - 0.1, 0, 2], [k, 0, 2], [k, 0, 2], [k + 0.1, 0, 2], [k, 9, 9]], np.float32)
        clouds.append(
            ObjectCloud(
                label=label, score=0.5, instance=k, xyz=xyz, normals=np.zeros_like(xyz), rgb=None,
                flags=np.zeros(5, np.uint16), density=1.0,
            )
        )  # fmt: skip
    view = View(
        xyz=np.ones((6, 8, 3), np.float32), grey=None,
        intrinsics=Intrinsics(fx=5.0, fy=5.0, cx=3.5, cy=2.5, width=8, height=6),
    )  # fmt: skip
    return Frame(
        objects=tuple(clouds), support=None, view=view, gravity=None, gravity_confidence=0.0, T_odom_camera=None,
        stamp_ns=stamp_ns,
    )  # fmt: skip


def objects(stamp_ns: int, *labels: str) -> Any:
    return to_msg.objects(frame(stamp_ns, *labels), NAMES)


def camera(stamp_ns: int) -> Any:
    return to_msg.view_camera_info(frame(stamp_ns))


def span(xyz: np.ndarray, intrinsics: Intrinsics) -> str:
    """Stands in for an outline: how many points, and how wide the picture is."""
    return f"{len(xyz)} of {intrinsics.width}"


def status(node: str, *own: Diagnostics, balance: Balance = BALANCE) -> DiagnosticArray:
    return diagnostic(node, Time(), (), CommonDiagnostics.of(balance, 30.0), *own)


def test_the_counters_of_every_node_are_kept_as_they_were_reported_last(collector: Collector) -> None:
    receive(collector, "/diagnostics", status("/detector", balance=Balance(1, 1, 0, {}, {})))
    receive(collector, "/diagnostics", status("/detector"))
    receive(collector, "/diagnostics", status("/robot/segmenter"))
    assert collector.counters == {"/detector": BALANCE, "/robot/segmenter": BALANCE} and collector.rejected == {}


def test_refusals_are_counted_by_reason_and_kept_with_their_numbers(collector: Collector) -> None:
    receive(collector, "/diagnostics", status("/registrar", REGISTRAR))
    turned_down = Rejected(reason=Reason.NO_CANDIDATE, from_ns=5, to_ns=9, detail="none of 3")
    receive(collector, "/refusals", refusals("/registrar", Time(), [turned_down]))
    assert collector.rejected == {"no_candidate": 3} and collector.counters.keys() == {"/registrar"}
    assert [(r.reason, r.from_ns, r.detail) for r in collector.refusals] == [(Reason.NO_CANDIDATE, 5, "none of 3")]


def test_the_counters_of_strangers_are_left_aside(collector: Collector) -> None:
    strange = DiagnosticStatus(
        name="motor: temperature", hardware_id="motor", values=[KeyValue(key="hot", value="yes")]
    )
    receive(collector, "/diagnostics", DiagnosticArray(status=[strange, *status("/detector").status]))
    assert collector.counters.keys() == {"/detector"}


def test_constraints_are_kept_in_their_order(collector: Collector) -> None:
    for to_ns in (9, 7):
        closure = LoopClosure(from_ns=5, to_ns=to_ns, T_from_to=np.eye(4), covariance=np.eye(6), labels=())
        receive(collector, "/constraints", to_msg.constraint(closure))
    assert [(closure.from_ns, closure.to_ns) for closure in collector.closures] == [(5, 9), (5, 7)]


def test_a_glimpse_holds_what_was_detected_and_where_the_objects_were(collector: Collector) -> None:
    receive(collector, "/labels", to_msg.labels(NAMES))
    receive(collector, "/detections_table", detections(5, "tv", "cup"))
    receive(collector, "/objects", objects(5, "cup", "tv"))
    receive(collector, "/objects", objects(6))
    assert collector.glimpses == {
        5: {"stamp_ns": 5, "labels": ["tv", "cup"], "objects": [["cup", [1.0, 0.0, 2.0]], ["tv", [2.0, 0.0, 2.0]]]},
        6: {"stamp_ns": 6, "labels": [], "objects": []},
    }


@pytest.mark.parametrize("collector", [span], indirect=True)
def test_objects_get_their_outlines_whether_they_or_their_camera_come_first(collector: Collector) -> None:
    receive(collector, "/objects", objects(5, "cup", "tv"))
    assert "outlines" not in collector.glimpses[5]
    receive(collector, "/view/camera_info", camera(6))
    receive(collector, "/view/camera_info", camera(5))
    receive(collector, "/objects", objects(6, "cup"))
    assert [collector.glimpses[k]["outlines"] for k in (5, 6)] == [["5 of 8", "5 of 8"], ["5 of 8"]]
    receive(collector, "/objects", objects(5))
    assert "outlines" not in collector.glimpses[5], "those of other objects of the same stamp"


@pytest.mark.parametrize("collector", [span], indirect=True)
def test_no_more_objects_wait_for_their_camera_than_are_recent(collector: Collector) -> None:
    for stamp_ns in range(collector_module.RECENT + 1):
        receive(collector, "/objects", objects(stamp_ns, "cup"))
    for stamp_ns in (0, 1):
        receive(collector, "/view/camera_info", camera(stamp_ns))
    assert "outlines" not in collector.glimpses[0] and collector.glimpses[1]["outlines"] == ["5 of 8"]


def test_before_the_labels_come_classes_are_called_by_their_numbers(collector: Collector) -> None:
    receive(collector, "/detections_table", detections(5, "tv"))
    assert collector.glimpses[5]["labels"] == ["7"]


def test_an_image_without_an_object_leaves_no_trace(collector: Collector) -> None:
    receive(collector, "/detections_table", detections(5))
    receive(collector, "/objects", objects(5, "cup"))
    assert collector.glimpses[5]["labels"] == [] and collector.sight is None


def test_the_sight_is_the_latest_of_the_frames_with_most_objects_with_the_detections_next_to_it(
    collector: Collector,
) -> None:
    receive(collector, "/labels", to_msg.labels(NAMES))
    for stamp_ns, seen in ((10, ("cup",)), (20, ("cup", "tv")), (30, ("tv", "cup")), (40, ("tv",))):
        receive(collector, "/detections_table", detections(stamp_ns, *seen))
    for stamp_ns, seen in ((11, ("cup",)), (21, ("cup", "tv")), (31, ("tv", "cup")), (41, ("tv",))):
        receive(collector, "/objects", objects(stamp_ns, *seen))
    sight = collector.sight
    assert sight is not None and sight.detections.stamp_ns == 30
    assert [item.label for item in sight.objects] == ["tv", "cup"]


def test_no_more_detections_wait_for_their_objects_than_are_recent(collector: Collector) -> None:
    for stamp_ns in range(collector_module.RECENT + 1):
        receive(collector, "/detections_table", detections(stamp_ns, "tv"))
    receive(collector, "/objects", objects(0, "tv"))
    assert collector.sight is not None and collector.sight.detections.stamp_ns == 1


def test_it_waits_until_something_is_true_or_the_time_is_over(collector: Collector) -> None:
    asked: list[None] = []
    assert collector.spin_until(lambda: len(asked) == 3 or asked.append(None) is not None, float("inf"))
    assert not collector.spin_until(lambda: False, 0.0)


def test_a_service_is_called_and_its_message_comes_back(collector: Collector) -> None:
    def save(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success, response.message = True, "3 keyframes"
        return response

    collector.create_service(Trigger, "registrar/save", save)
    assert collector.call("registrar/save", 20.0) == "3 keyframes"


def test_a_service_that_nobody_offers_says_nothing(collector: Collector) -> None:
    assert collector.call("registrar/save", 0.0) == ""
