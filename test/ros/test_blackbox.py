# SPDX-License-Identifier: Apache-2.0
"""The black box beside live nodes: what it writes has the inputs as they came, and gives the same verdict offline.

The same verdict: both cut the same keyframes, and give the same outcome for the same pairs, a constraint or the reason
of a refusal, where the file holds all since the registrar began.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import PointCloud2
from std_srvs.srv import Trigger

from objreg_ros.bridge.messages import headers
from objreg_ros.bridge.node.diagnostics import accepted_of, refusal_of
from objreg_tools.recording import open_recording

from .graph import START_S, Graph
from .test_flow import call
from .test_replay import objreg

pytestmark = [pytest.mark.ros, pytest.mark.slow]
INPUTS = ("/image", "/depth/image", "/camera_info", "/odom")
QUIET_S = 3.0
ACCEPTED = "accepted"
NODES = ("detector", "segmenter", "registrar")


@pytest.fixture(scope="module")
def orbit(graph: Graph, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated room, around one table of which the camera goes."""
    folder = tmp_path_factory.mktemp("orbit") / "bag"
    words = ("--scenario", "orbit", "--seed", "1", "--frames", "50", "--rate", "10", "--intrinsics", "qvga")
    objreg(graph, "simulate", str(folder), *words)
    return folder


@pytest.fixture(scope="module")
def played(graph: Graph, orbit: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The folder of a black box behind a lossless replay of the orbit."""
    folder = tmp_path_factory.mktemp("boxes")
    for node in NODES:
        graph.start(node, node, "-p reliable:=true")
    box = "-p reliable:=true", "-p blackbox_seconds:=60.0", f"-p blackbox_folder:={folder}"
    graph.start("blackbox", "blackbox", *box)
    for topic, kind in (("refusals", DiagnosticArray), ("acceptances", DiagnosticArray), ("landmarks", PointCloud2)):
        graph.receive(kind, topic)
    graph.wait_for(lambda: {f"/{name}" for name in ("blackbox", *NODES)} <= graph.counters.keys(), START_S)
    objreg(graph, "replay", str(orbit), "--lossless", "--wait", str(START_S))
    call(graph, Trigger, "registrar/save")  # ends the last keyframe; a temporary store is not saved
    wait_for_quiet(graph)
    yield folder


def wait_for_quiet(graph: Graph) -> None:
    """Until nothing more is decided for a while: what waits for other keyframes is announced with the call above."""
    last, since = -1, time.monotonic()

    def quiet() -> bool:
        nonlocal last, since
        count = sum(map(len, graph.received.values()))
        if count != last:
            last, since = count, time.monotonic()
        return time.monotonic() - since > QUIET_S

    graph.wait_for(quiet, what="the registrar to be done")


def live_verdicts(graph: Graph) -> dict[tuple[int, int], str]:
    found = dict[tuple[int, int], str]()
    for message in graph.received["refusals"]:
        for no in map(refusal_of, message.status):
            found[no.from_ns, no.to_ns] = no.reason.value
    for message in graph.received["acceptances"]:
        for status in message.status:
            found[accepted_of(status)[0]] = ACCEPTED
    return found


def offline_verdicts(summary: Mapping[str, Any]) -> dict[tuple[int, int], str]:
    found = {(no["from_ns"], no["to_ns"]): no["reason"] for no in summary["refusals"]}
    return {**found, **{(yes["from_ns"], yes["to_ns"]): ACCEPTED for yes in summary["constraints"]}}


def about(file: Path) -> dict[str, Any]:
    with open_recording(file) as opened:
        (record,) = opened.records(["/blackbox"])
        return json.loads(record.message.data)


def test_a_run_on_the_file_gives_the_verdicts_of_the_live_graph(graph: Graph, played: Path, tmp_path: Path) -> None:
    done, path = call(graph, Trigger, "blackbox/write")
    assert done, path
    file, out = Path(path), tmp_path / "offline.json"
    said = about(file)
    assert (said["event"], said["topics"]["image"]) == ("called", "/image")
    assert said["parameters"].keys() == {f"/**/{node}" for node in NODES}
    objreg(graph, "offline", str(file), "--params", str(file.with_suffix(".yaml")), "--json", str(out))
    live, offline = live_verdicts(graph), offline_verdicts(json.loads(out.read_text()))
    keyframes = {headers.stamp_ns(message) for message in graph.received["landmarks"]}
    assert {to_ns for _, to_ns in offline} <= keyframes
    assert offline == live and ACCEPTED in live.values() and len(set(live.values())) > 3


def test_the_inputs_are_in_the_file_byte_for_byte(graph: Graph, played: Path, orbit: Path) -> None:
    done, path = call(graph, Trigger, "blackbox/write")
    assert done, path
    with open_recording(orbit) as recording, open_recording(Path(path)) as file:
        for topic in INPUTS:
            sent = [record.cdr for record in recording.records([topic])]
            kept = [record.cdr for record in file.records([topic])]
            assert len(kept) == len(sent), topic
            for one, other in zip(kept, sent, strict=True):
                assert bytes(one)[: len(other)] == bytes(other) and not any(one[len(other) :]), topic
                assert len(one) - len(other) < 4, topic  # DDS fills up to whole words
