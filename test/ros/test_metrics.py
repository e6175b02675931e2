# SPDX-License-Identifier: Apache-2.0
"""`objreg metrics` beside a graph of real processes that a simulated recording is played into."""

from __future__ import annotations

import re
import signal
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest
from prometheus_client.openmetrics.parser import text_string_to_metric_families

from objreg_tools.cli.commands.simulate import camera_of, sensors_of
from objreg_tools.simulation.write import simulate

from .graph import START_S, Graph

pytestmark = pytest.mark.ros
ACCEPT = "application/openmetrics-text;version=1.0.0"


@pytest.fixture
def fresh(domain: int, tmp_path: Path) -> Iterator[Graph]:
    made = Graph(domain, tmp_path)
    yield made
    made.close()


def scraped(address: str) -> dict[tuple[str, str], float]:
    """The sum over other labels of each metric, by its name and node."""
    request = urllib.request.Request(address, headers={"Accept": ACCEPT})
    with urllib.request.urlopen(request, timeout=60) as answer:
        assert answer.headers["Content-Type"].startswith("application/openmetrics-text")
        families = list(text_string_to_metric_families(answer.read().decode()))
    found: dict[tuple[str, str], float] = {}
    for sample in (sample for family in families for sample in family.samples):
        key = sample.name, sample.labels["node"]
        found[key] = found.get(key, 0.0) + sample.value
    return found


def test_a_graph_that_runs_is_measured_until_ctrl_c(fresh: Graph, tmp_path: Path) -> None:
    simulate(
        tmp_path / "bag", "orbit", 1, 50, 15.0, sensors_of(camera_of("kinect", "320x240"), stress=False, settings=())
    )
    for stage in ("detector", "segmenter", "registrar"):
        fresh.start(stage, stage, "-p reliable:=true", *(["-p model:=objreg_ssd.onnx"] if stage == "detector" else []))
    objreg = [*fresh.command("detector")[:2], "objreg_tools.cli"]
    fresh._start("metrics", [*objreg, "metrics", "--port", "0"])
    fresh.wait_for(lambda: "Ctrl-C" in fresh.log("metrics"), START_S, "the address of the metrics")
    address = re.search(r"http://127\.0\.0\.1:\d+/metrics", fresh.log("metrics"))[0]  # type: ignore[index]
    nodes = ("/detector", "/segmenter", "/registrar")
    fresh.wait_for(lambda: all(("objreg_node_up", n) in scraped(address) for n in nodes), START_S, "three nodes")
    assert scraped(address)["objreg_closures_total", "/registrar"] == 0.0
    fresh._start("player", [*objreg, "replay", str(tmp_path / "bag"), "--lossless"])
    deadline = time.monotonic() + START_S
    while not (seen := scraped(address)).get(("objreg_since_last_closure_seconds", "/registrar")):
        assert time.monotonic() < deadline, seen
        time.sleep(0.3)
    assert seen["objreg_closures_total", "/registrar"] > 0 and seen["objreg_refusals_total", "/registrar"] > 0
    assert seen["objreg_frames_received_total", "/detector"] > 0 and seen["objreg_stream_doubted", "/registrar"] == 0
    assert 0 < seen["objreg_latency_p50_seconds", "/segmenter"] <= seen["objreg_latency_p95_seconds", "/segmenter"]
    fresh.processes["player"].wait(START_S)
    fresh.processes.pop("player")
    assert fresh.stop("metrics", signal.SIGINT) == 130 and "Traceback" not in fresh.log("metrics")
