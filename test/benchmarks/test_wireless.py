# SPDX-License-Identifier: Apache-2.0
"""What the benchmark of a bad link asks of its nodes, and how it counts what they receive."""

from __future__ import annotations

import importlib
import os
from types import ModuleType, SimpleNamespace

import pytest
from click.testing import CliRunner

from objreg_ros.bridge.process.profile import MODE, VARIABLES

REST = {"delay_ms": 20.0, "mbit": 6.0, "messages": 3, "size": 80_000, "peers": False, "linger_s": 1.5, "seed": 0}


@pytest.fixture
def wireless() -> ModuleType:
    return importlib.import_module("wireless")


def test_what_came_is_counted_once_and_aged_at_its_first_coming(wireless: ModuleType) -> None:
    result = wireless.summary(["0 0.1", "1 0.3", "0 9.0", "2 0.2", "0 9.5"], 1.0, 2.0, (4000, 1000))
    assert (result.got, result.twice, result.age_p50_s) == (3, 1, 0.2)
    assert (result.sender_kb_s, result.receiver_kb_s) == (2.0, 0.5)
    assert wireless.summary([], 1.0, 2.0, (0, 0)).age_p50_s is None


def test_each_profile_is_run_with_each_trouble_and_others_than_fast_dds_have_none(wireless: ModuleType) -> None:
    rmws, profiles = ("rmw_fastrtps_cpp", "rmw_zenoh_cpp"), (wireless.OWN, "config/fastdds_wifi.xml")
    made = list(wireless.cases(rmws, profiles, ("0:0", "0.2:30"), **REST))
    assert [case.profile for case in made] == [profiles[0]] * 2 + [profiles[1]] * 2 + [wireless.OWN] * 2
    assert [(case.loss, case.pause_s) for case in made[:2]] == [(0.0, 0.0), (0.2, 30.0)]
    assert not any(case.peers for case in made)


def test_the_last_profile_is_run_with_static_peers_too(wireless: ModuleType) -> None:
    made = wireless.cases(["rmw_fastrtps_cpp"], (wireless.OWN, "x.xml"), ("0.2:0",), **{**REST, "peers": True})
    assert [(case.profile, case.peers) for case in made] == [(wireless.OWN, False), ("x.xml", False), ("x.xml", True)]


def test_a_node_has_the_profile_of_its_case_and_none_of_ours(
    wireless: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLES[1], "another.xml")
    own, wifi = wireless.cases(["rmw_fastrtps_cpp"], (wireless.OWN, "config/fastdds_wifi.xml"), ("0:0",), **REST)
    assert not {*VARIABLES, MODE} & set(wireless.environment_of(own, "10.75.0.1"))
    environment = wireless.environment_of(wifi, "10.75.0.1")
    assert environment[VARIABLES[1]].endswith("config/fastdds_wifi.xml") and environment[MODE] == "AUTO"
    assert environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "SUBNET"


def test_a_run_is_reported_in_a_row_and_one_whose_ends_never_met_too(wireless: ModuleType) -> None:
    (case,) = wireless.cases(["rmw_fastrtps_cpp"], ["config/fastdds_wifi.xml"], ["0.2:30"], **REST)
    result = wireless.Result(1.0, 2, 1, 0.123, 4.567, 96.4, 1.6, 1442)
    link = "| rmw_fastrtps_cpp, fastdds_wifi.xml | 20%, pause of 30 s |"
    assert wireless.row(case, result) == f"{link} 2 of 3 | 1 | 0.12 / 4.57 | 96 + 2 |"
    assert wireless.row(case, wireless.Result(None)) == f"{link} never met | | | |"


def test_the_link_is_cut_once_both_ends_talk_and_the_sender_ends_the_run(
    wireless: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[object] = []
    monkeypatch.setattr(wireless.time, "sleep", done.append)
    hosts, sender = (
        SimpleNamespace(pause=lambda s: done.append(("cut", s))),
        SimpleNamespace(wait=lambda: done.append("end")),
    )
    wireless.carry(hosts, sender, 0.0)
    wireless.carry(hosts, sender, 30.0)
    assert done == ["end", wireless.PAUSE_AT_S, ("cut", 30.0), "end"]


def test_what_is_not_installed_is_skipped_by_name(wireless: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wireless, "lack", lambda: None)
    result = CliRunner().invoke(wireless.main, ["--rmw", "rmw_of_nobody_cpp"])
    assert result.exit_code == 0 and "rmw_of_nobody_cpp is skipped: it is not installed" in result.output


@pytest.mark.slow
@pytest.mark.skipif("OBJREG_WIRELESS" not in os.environ, reason="set OBJREG_WIRELESS=1 to send over a bad link")
def test_keyframes_come_through_a_link_that_loses_a_fifth(wireless: ModuleType) -> None:
    pytest.importorskip("rclpy", reason="the ends are nodes of ROS 2")
    if (missing := importlib.import_module("hosts").lack()) is not None:
        pytest.skip(missing)
    (case,) = wireless.cases(["rmw_fastrtps_cpp"], ["config/fastdds_wifi.xml"], ["0.2:0"], **REST)
    result = wireless.run(case)
    assert (result.got, result.twice) == (3, 0) and 0.1 < result.age_p50_s < 5.0
    assert result.longest_frame <= 1400 + 28 + 14, "no datagram is cut by IP, which one lost piece would spoil"
