# SPDX-License-Identifier: Apache-2.0
"""A person withdraws a closure of a live graph: the mapper loses it, it is not found again, and undo brings it back."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from nav_msgs.msg import Odometry
from registration import rooms
from std_msgs.msg import Header

from objreg_ros.bridge.messages import closures_msg
from objreg_ros.bridge.node import qos, services
from objreg_ros.geometry import pose_error

from .graph import START_S, Graph
from .test_peer import call
from .test_relocalised import BESIDE, HERE, MOUNT, frame, send_frame

pytestmark = [
    pytest.mark.ros,
    pytest.mark.skipif(services.Veto is None, reason="objreg_msgs is not installed"),
    pytest.mark.skipif(find_spec("gtsam") is None, reason="gtsam is not installed"),
]
AWAY = rooms.look_at((0.2, 0.0, 1.3), (2.8, -1.4, 1.0))
SECOND = 1_000_000_000


@pytest.fixture
def fresh(domain: int, tmp_path: Path) -> Iterator[Graph]:
    made = Graph(domain, tmp_path)
    yield made
    made.close()


def count(graph: Graph, key: str) -> int:
    """What the mapper's diagnostics say."""
    values = {item.key: item.value for item in graph.status["/mapper"].values} if "/mapper" in graph.status else {}
    return int(float(values.get(key, "-1").split()[0]))


def drive(graph: Graph, *places: tuple[int, object]) -> None:
    frames = [frame(seconds, T, T) for seconds, T in places]  # type: ignore[arg-type]
    names = dict(enumerate(sorted({cloud.label for one in frames for cloud in one.objects})))
    for one in frames:
        send_frame(graph, one, names)
        graph.answer("registrar", one.stamp_ns)


def test_a_vetoed_closure_leaves_the_map_is_not_found_again_and_comes_back(fresh: Graph) -> None:
    fresh.receive(Header, "finished")
    fresh.receive(closures_msg.LoopClosureMsg, "loop_closures", qos.latched(qos.KEPT_CONSTRAINTS))
    fresh.receive(Odometry, "constraints", qos.latched(qos.KEPT_CONSTRAINTS))
    fresh.start("registrar", "registrar", "-p reliable:=true", "-p thin_seconds:=0.1", MOUNT)
    fresh.start("mapper", "mapper", "-p publish_tf:=false", MOUNT)
    fresh.wait_for(lambda: {"/mapper", "/registrar"} <= set(fresh.counters), START_S, "the nodes")
    drive(fresh, (10, HERE), (13, AWAY), (40, BESIDE), (43, AWAY), (46, BESIDE))
    fresh.wait_for(lambda: bool(fresh.received["loop_closures"]), what="a closure")
    closures: dict[str, Any] = {}

    def all_are_kept() -> bool:  # the rest of them may come after the first
        closures.update((one.id, one) for one in fresh.received["loop_closures"])
        return count(fresh, "constraints kept") == len(closures)

    fresh.wait_for(all_are_kept, what="the closures in the map")

    answer = call(fresh, services.Veto, "registrar/veto", ids=[*closures, "no closure"])
    assert not answer.success and "no closure" in answer.message
    answer = call(fresh, services.Veto, "registrar/veto", ids=list(closures))
    assert answer.success, answer.message
    fresh.wait_for(lambda: count(fresh, "constraints retracted") == len(closures), what="the retraction in the mapper")
    fresh.wait_for(lambda: count(fresh, "constraints kept") == 0, what="the map without the closures")
    gone = fresh.received["loop_closures"][len(closures) :]
    assert {one.id for one in gone} == set(closures) and all(one.retracted for one in gone)

    drive(fresh, (49, BESIDE), (52, AWAY))
    before = [one for one in fresh.received["loop_closures"] if not one.retracted and one.id not in closures]
    for one in map(closures_msg.read_loop_closure, before):  # other revisits may close, but not with a withdrawn pose
        for old in map(closures_msg.read_loop_closure, closures.values()):
            degrees, centimetres = pose_error(one.T_from_to, old.T_from_to)
            assert one.from_ns != old.from_ns or degrees > 2.0 or centimetres > 5.0

    answer = call(fresh, services.Veto, "registrar/veto", ids=list(closures), undo=True)
    assert answer.success, answer.message
    fresh.wait_for(lambda: count(fresh, "constraints kept") >= len(closures), what="the closures in the map again")
    back = [one for one in fresh.received["loop_closures"] if one.id in closures][2 * len(closures) :]
    assert {one.id for one in back} == set(closures) and not any(one.retracted for one in back)
