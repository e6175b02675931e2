# SPDX-License-Identifier: Apache-2.0
"""What any peer may ask of nodes that run: no file of the user's is written over, and no store is emptied."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool, Trigger

from objreg_ros.memory.store import Store

from .graph import START_S, Graph

pytestmark = [pytest.mark.ros, pytest.mark.skipif(find_spec("gtsam") is None, reason="gtsam is not installed")]
NODES = "mapper", "registrar", "objreg_to_g2o"


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a file of the user's in it, and a pipe."""
    folder = tmp_path_factory.mktemp("home")
    (folder / "precious.npz").write_text("precious")
    os.mkfifo(folder / "pipe")
    return folder


@pytest.fixture(scope="module")
def asked(graph: Graph, home: Path) -> Iterator[Graph]:
    """Mapper, registrar and g2o adapter, as a user starts them."""
    graph.start("mapper", "mapper", f"-p graph_path:={home}/map.g2o")
    graph.start("registrar", "registrar", f"-p store:={home}/place.db")
    graph.start_module("objreg_to_g2o", "objreg_mapper.adapters.g2o", f"-p graph_path:={home}/out.g2o")
    graph.wait_for(lambda: {f"/{name}" for name in NODES} <= set(graph.counters), START_S, "the nodes")
    yield graph
    assert [graph.stop(name) for name in NODES] == [0] * len(NODES)


def call(graph: Graph, kind: Any, service: str, **fields: Any) -> Any:
    """The answer of a service, once it has rested from an earlier call."""
    answer = called(graph, kind, service, **fields)
    while ": call again" in getattr(answer, "message", ""):
        time.sleep(0.2)
        answer = called(graph, kind, service, **fields)
    return answer


def called(graph: Graph, kind: Any, service: str, **fields: Any) -> Any:
    client = graph.node.create_client(kind, service)
    graph.wait_for(client.service_is_ready, what=service)
    answer = client.call_async(kind.Request(**fields))
    graph.wait_for(answer.done, 10.0, service)
    return answer.result()


@pytest.mark.parametrize(
    ("node", "name", "value"),
    [
        ("mapper", "graph_path", "precious.npz"),
        ("mapper", "graph_path", "pipe"),
        ("objreg_to_g2o", "graph_path", "precious.npz"),
        ("registrar", "store", "precious.npz"),
        ("registrar", "allow_remote_reset", True),
    ],
)
def test_no_peer_says_which_files_are_written(asked: Graph, home: Path, node: str, name: str, value: Any) -> None:
    meant = Parameter(name, value=str(home / value) if isinstance(value, str) else value).to_parameter_msg()
    (refused,) = call(asked, SetParameters, f"{node}/set_parameters", parameters=[meant]).results
    assert not refused.successful
    assert call(asked, Trigger, f"{node}/save").success
    assert (home / "precious.npz").read_text() == "precious"


def test_a_save_keeps_what_is_not_ours_and_opens_no_pipe(asked: Graph, home: Path) -> None:
    for path in (home / "map.npz", home / "out.g2o"):
        path.unlink(missing_ok=True)
    (home / "map.npz").write_text("precious")
    os.mkfifo(home / "out.g2o")
    assert "got another file" in call(asked, Trigger, "mapper/save").message
    assert "expected a plain file" in call(asked, Trigger, "objreg_to_g2o/save").message
    assert (home / "map.npz").read_text() == "precious"
    (home / "out.g2o").unlink()


def test_no_peer_empties_a_store(asked: Graph, home: Path) -> None:
    answer = call(asked, Trigger, "registrar/reset")
    assert not answer.success and "allow_remote_reset" in answer.message
    Store(home / "place.db", read_only=True).close()


def test_who_disables_a_node_is_seen_in_its_diagnostics(asked: Graph) -> None:
    for node in ("mapper", "registrar"):
        for on in (False, True):
            assert call(asked, SetBool, f"{node}/enable", data=on).success
            asked.wait_for(
                lambda on=on, node=node: ("disabled by ~/enable" in asked.status[f"/{node}"].message) is not on,
                what=f"the state of {node}",
            )
