# SPDX-License-Identifier: Apache-2.0
"""`objreg watch` beside a graph of real processes that a simulated recording is played into."""

from __future__ import annotations

import json
import re
import signal
import time
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from objreg_tools.cli.commands.simulate import camera_of, sensors_of
from objreg_tools.simulation.write import simulate

from .graph import ANSWER_S, START_S, Graph

pytestmark = pytest.mark.ros


@pytest.fixture
def fresh(domain: int, tmp_path: Path) -> Iterator[Graph]:
    made = Graph(domain, tmp_path)
    yield made
    made.close()


def asked(address: str) -> Any:
    with urllib.request.urlopen(address, timeout=60) as answer:
        return answer.read()


def wait_for(done: Callable[[], Any], seconds: float) -> Any:
    deadline = time.monotonic() + seconds
    while not (found := done()):
        assert time.monotonic() < deadline
        time.sleep(0.3)
    return found


def test_a_graph_that_runs_is_on_the_page_until_ctrl_c(fresh: Graph, tmp_path: Path) -> None:
    simulate(
        tmp_path / "bag", "orbit", 1, 50, 15.0, sensors_of(camera_of("kinect", "320x240"), stress=False, settings=())
    )
    for stage in ("detector", "segmenter", "registrar"):
        fresh.start(stage, stage, "-p reliable:=true", *(["-p model:=objreg_ssd.onnx"] if stage == "detector" else []))
    fresh._start("watch", [*fresh.command("detector")[:2], "objreg_tools.cli", "watch", "--port", "0"])
    fresh.wait_for(lambda: "Ctrl-C" in fresh.log("watch"), START_S, "the address of the page")
    address = re.search(r"http://127\.0\.0\.1:\d+/", fresh.log("watch"))[0]  # type: ignore[index]
    state = lambda: json.loads(asked(f"{address}state.json"))  # noqa: E731
    wait_for(lambda: len(state()["nodes"]) == 3, START_S)
    fresh._start("player", [*fresh.command("detector")[:2], "objreg_tools.cli", "replay", str(tmp_path / "bag"),
                            "--lossless"])  # fmt: skip
    wait_for(lambda: state()["picture"], START_S)
    seen = wait_for(lambda: (made := state())["closures"] and made["refusals"] and made, START_S)
    assert seen["closures"][0]["labels"] and seen["closures"][0]["odds"] is not None
    assert len(wait_for(lambda: state()["odometry"], ANSWER_S)) > 1
    assert asked(f"{address}picture.jpg")[:2] == b"\xff\xd8" and b"objreg watch" in asked(address)
    fresh.processes["player"].wait(START_S)
    fresh.processes.pop("player")
    assert wait_for(lambda: state()["edges"].get("accepted"), ANSWER_S)
    assert fresh.stop("watch", signal.SIGINT) == 130 and "Traceback" not in fresh.log("watch")
