# SPDX-License-Identifier: Apache-2.0
"""How a live run is started, waited for and ended, on a stage without processes and without ROS."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

import numpy as np
import pytest

from objreg_ros.bridge.node.accounting import Balance
from objreg_ros.data.closures import LoopClosure, Reason, Rejected
from objreg_tools.cli.live import STAGES, Live, Setup, private_environment, run_live

BAG = Path("some/bag")
CLOSURE = LoopClosure(from_ns=1, to_ns=2, T_from_to=np.eye(4), covariance=np.eye(6), labels=())
REFUSAL = Rejected(reason=Reason.NO_CANDIDATE, from_ns=7, to_ns=7, detail="none of 3")


def counters(published: int, waiting: int = 0) -> Balance:
    return Balance(published + waiting, published, waiting, {}, {})


class Stage:
    """Stands in for ROS, the processes and the collector. ``events`` are what happens, each so many seconds later."""

    def __init__(self) -> None:
        self.events: list[tuple[float, Callable[[], object]]] = []
        self.started: dict[str, tuple[str, list[str], bool]] = {}
        self.environment: Mapping[str, str] = {}
        self.failure: str | None = None
        self.code: int | None = None
        self.said: list[str] = []
        self.called: list[str] = []
        self.saved: Callable[[], object] = lambda: None
        self.closed = self.shut_down = self.left = False
        self.counters: dict[str, Balance] = {}
        self.rejected = {"no_candidate": 1}
        self.closures: list[LoopClosure] = []
        self.refusals: list[Rejected] = []
        self.sight = None
        self.glimpses: dict[int, dict[str, Any]] = {}

    # As ROS and as the processes

    def init(self, args: Sequence[str]) -> None:
        assert args == []  # the command line is not for ROS

    def try_shutdown(self) -> None:
        assert self.closed
        self.shut_down = True

    def processes(self, folder: Path, environment: Mapping[str, str]) -> Self:
        self.environment = environment
        return self

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.left = True

    def start(self, name: str, module: str, arguments: Sequence[str], quiet: bool = True) -> Self:
        self.started[name] = (module, list(arguments), quiet)
        return self

    def poll(self) -> int | None:
        return self.code

    def require_alive(self) -> None:
        if self.failure:
            raise ValueError(self.failure)

    # As the collector

    def spin_until(self, true: Callable[[], bool], seconds: float) -> bool:
        while not true():
            if not self.events or self.events[0][0] > seconds:
                return False
            after, event = self.events.pop(0)
            seconds -= after
            event()
        return True

    def call(self, service: str, seconds: float) -> str:
        self.called.append(service)
        self.saved()
        return ""

    def close(self) -> None:
        self.closed = True

    # What happens

    def reports(self, **balances: Balance) -> Callable[[], object]:
        return lambda: self.counters.update({f"/{node}": balance for node, balance in balances.items()})

    def ends(self) -> None:
        """The player has played all."""
        assert "player" in self.started
        self.code = 0

    def fails(self) -> None:
        self.failure = "registrar ended with status 1"

    def run(self, setup: Setup | None = None) -> Live:
        return run_live(BAG, setup or Setup(), Path("logs"), self.said.append)


@pytest.fixture
def stage(monkeypatch: pytest.MonkeyPatch) -> Stage:
    """A stage on which all nodes report after a second, and whose player ends at once."""
    made = Stage()
    made.events = [(1.0, made.reports(**dict.fromkeys(STAGES, counters(0)))), (1.0, made.ends)]
    monkeypatch.setattr("objreg_tools.cli.live.Processes", made.processes)
    monkeypatch.setattr("rclpy.context.Context", lambda: made)
    monkeypatch.setattr("objreg_ros.bridge.streams.collector.Collector", lambda context, outline: made)
    monkeypatch.setattr("os.environ", {"HOME": "/home/me"})
    return made


def test_the_nodes_get_their_arguments_and_the_player_the_recording(stage: Stage) -> None:
    stage.run(Setup({"detector": ["-p", "model:=a"], "registrar": []}, ["--rate", "2"]))
    assert stage.started == {
        "detector": ("objreg_ros.detector.node", ["--ros-args", "-p", "model:=a"], True),
        "segmenter": ("objreg_ros.segmenter.node", [], True),
        "registrar": ("objreg_ros.registrar.node", [], True),
        "player": ("objreg_tools.cli", ["replay", "some/bag", "--rate", "2"], False),
    }
    assert [line.split()[0] for line in stage.said] == ["starting", "playing", "waiting"]


def test_what_was_collected_comes_back_with_bare_names_and_in_order_of_time(stage: Stage) -> None:
    stage.glimpses = {k: {"stamp_ns": k} for k in (9, 4, 6)}
    stage.closures, stage.refusals = [CLOSURE], [REFUSAL]
    live = stage.run()
    assert live.counters == dict.fromkeys(STAGES, counters(0)) and live.rejected == {"no_candidate": 1}
    assert [glimpse["stamp_ns"] for glimpse in live.glimpses] == [4, 6, 9]
    assert (live.closures, live.refusals, live.sight) == ((CLOSURE,), (REFUSAL,), None)


def test_the_listener_and_the_processes_are_on_one_domain(stage: Stage) -> None:
    stage.run()
    assert stage.environment["ROS_DOMAIN_ID"] == os.environ["ROS_DOMAIN_ID"]
    assert stage.environment["HOME"] == "/home/me" and stage.closed and stage.shut_down and stage.left


def test_the_keyframe_in_hand_is_ended_when_all_is_through_and_what_comes_of_it_counts(stage: Stage) -> None:
    def last() -> None:
        assert not stage.called
        stage.reports(registrar=counters(8))()

    stage.events += [(2.0, stage.reports(detector=counters(8))), (2.0, last)]
    stage.saved = lambda: stage.closures.append(CLOSURE)
    live = stage.run()
    assert stage.called == ["registrar/save"] and not stage.events
    assert live.closures == (CLOSURE,) and live.counters["registrar"].published == 8


@pytest.mark.parametrize("node", ["detector", "registrar"])
def test_a_frame_that_is_worked_on_may_take_long(stage: Stage, node: str) -> None:
    stage.events += [
        (1.0, stage.reports(**{node: counters(7, waiting=1)})),
        (100.0, stage.reports(**{node: counters(8)})),
    ]
    assert stage.run().counters[node] == counters(8)


def test_a_frame_that_waits_for_a_partner_is_not_waited_for(stage: Stage) -> None:
    stage.events += [
        (1.0, stage.reports(segmenter=counters(7, waiting=1))),
        (100.0, stage.reports(segmenter=counters(8))),
    ]
    assert stage.run().counters["segmenter"] == counters(7, waiting=1) and stage.called


def test_a_node_that_ends_before_it_reports_is_named(stage: Stage) -> None:
    stage.events.insert(0, (1.0, stage.fails))
    with pytest.raises(ValueError, match="registrar ended with status 1"):
        stage.run()
    assert "player" not in stage.started and stage.closed and stage.left


def test_nodes_that_never_report_are_distinguished_from_those_that_do(stage: Stage) -> None:
    stage.events = [(1.0, stage.reports(detector=counters(0)))]
    with pytest.raises(ValueError, match=r"expected detector, .* to report within 120 s, got \['/detector'\]"):
        stage.run()


def test_a_process_that_failed_during_the_play_is_named(stage: Stage) -> None:
    stage.events.insert(1, (1.0, stage.fails))
    with pytest.raises(ValueError, match="registrar ended with status 1"):
        stage.run()
    assert not stage.called and stage.closed and stage.left


def test_a_private_environment_has_a_domain_of_its_own_on_this_machine_and_our_transport(stage: Stage) -> None:
    environment = private_environment()
    assert environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
    assert 1 <= int(environment["ROS_DOMAIN_ID"]) <= 100 and "FASTDDS_DEFAULT_PROFILES_FILE" in environment
    assert environment["HOME"] == "/home/me" and "ROS_DOMAIN_ID" not in os.environ


def test_a_private_environment_leaves_what_the_user_chose(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    chosen = {
        "ROS_DOMAIN_ID": "42",
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
        "FASTDDS_DEFAULT_PROFILES_FILE": "mine.xml",
    }
    monkeypatch.setattr("os.environ", chosen)
    assert private_environment() == chosen
