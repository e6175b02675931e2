# SPDX-License-Identifier: Apache-2.0
"""The table behind the policies of SROS 2 against nodes that run: what they open, it allows, and no more."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

from objreg_ros.bridge.camera.transforms import is_installed
from objreg_ros.bridge.messages import vision_to_msg
from objreg_ros.bridge.messages.closures_msg import LoopClosureMsg
from objreg_tools.cli.access import TF, Access, expanded
from objreg_tools.cli.commands.policy import PolicyOptions

from .graph import START_S, Graph

pytestmark = pytest.mark.ros

SPACE = "/robot1"
MANAGED = ("-p managed:=true", f"-r __ns:={SPACE}", "-r /tf:=tf", "-r /tf_static:=tf_static", "-p use_sim_time:=true")
ASKED = PolicyOptions(SPACE, robots={"r1": (), "r2": ("front",)}, exchange="/fleet")
# What a start, a parameter or a package that is not there decides.
LATER = {"tf", "initialpose", "labels"}
IN_PLACE = {  # by node what robots in its place stand for
    "registrar": {"r1/keyframes", "r1/labels", "r2/front/keyframes", "r2/front/labels"},
    "mapper": {"odom", "path", "correction"},
    "segmenter": {"odom", "detections_in", "label_info"},
}


@pytest.fixture(scope="module")
def open_nodes(graph: Graph, tiny_model: Path) -> Iterator[Graph]:
    """All five nodes, managed and active."""
    more = {
        "detector": (f"-p model:={tiny_model}",),
        "registrar": ("-p exchange:=/fleet",),
        "mapper": ("-p robots:=[r1,r2]",) if find_spec("gtsam") else (),
    }
    nodes = ["detector", "segmenter", "registrar", "keyframer", *(["mapper"] if find_spec("gtsam") else [])]
    for name in nodes:
        graph.start(name, "keyframes" if name == "keyframer" else name, *MANAGED, *more.get(name, ()))
    graph.wait_for(
        lambda: {f"{SPACE}/{name}" for name in nodes} <= set(graph.counters), START_S, "the counters of all nodes"
    )
    graph.wait_for(lambda: all(is_active(graph, name) for name in nodes), START_S, "active nodes")
    graph.wait_for(
        lambda: {(name, SPACE) for name in nodes} <= set(graph.node.get_node_names_and_namespaces()),
        START_S,
        "the names of all nodes, which discovery may bring later than their topics",
    )
    yield graph
    for name in nodes:
        graph.stop(name)


def is_active(graph: Graph, name: str) -> bool:
    values = {pair.key: pair.value for pair in graph.status[f"{SPACE}/{name}"].values}
    return values.get("state") == "active"


def opened(graph: Graph, name: str) -> Access:
    """What a node has opened, by full names."""
    node = graph.node
    asked = (
        node.get_publisher_names_and_types_by_node,
        node.get_subscriber_names_and_types_by_node,
        node.get_service_names_and_types_by_node,
        node.get_client_names_and_types_by_node,
    )
    return Access(*(tuple(full_name for full_name, _ in ask(name, SPACE)) for ask in asked))


@pytest.mark.parametrize("name", ["detector", "segmenter", "registrar", "keyframer", "mapper"])
def test_all_that_a_node_opens_is_allowed_and_nothing_is_that_it_never_opens(open_nodes: Graph, name: str) -> None:
    if name not in open_nodes.processes:
        pytest.skip("gtsam is not installed: the mapper does not start")
    for kind in ("writes", "reads", "serves", "calls"):
        may = set(expanded(getattr(ASKED.nodes()[name], kind), SPACE, name))
        awaited = may - set(expanded(LATER | IN_PLACE.get(name, set()) | absent(), SPACE, name))

        def missing(kind: str = kind, awaited: set[str] = awaited) -> set[str]:
            return awaited - set(getattr(opened(open_nodes, name), kind))

        # Discovery brings what an active node has opened a little later.
        open_nodes.wait_for(lambda missing=missing: not missing(), START_S, f"all that {name} {kind} by its policy")
        assert set(getattr(opened(open_nodes, name), kind)) <= may, f"{name} {kind} what no policy allows"


def absent() -> set[str]:
    """Topics and services of packages that are not installed here."""
    return {
        *(() if is_installed() else TF),
        *(() if vision_to_msg.Detection2DArray else ("detections", "detections_3d")),
        *(() if LoopClosureMsg else ("loop_closures", "r1/loop_closures", "r2/loop_closures")),
        *(() if LoopClosureMsg else ("closure_refusals", "object_landmarks", "localisation_state")),
        *(() if LoopClosureMsg else ("~/where", "~/veto")),
    }
