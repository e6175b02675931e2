# SPDX-License-Identifier: Apache-2.0
"""What the rows of docs/figures.md take from the JSON of a benchmark, by known answers; and what a machine lacks."""

from __future__ import annotations

import importlib
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

WIFI = "config/fastdds_wifi.xml"
RUN = {
    "loss": 0.2,
    "pause_s": 0.0,
    "peers": False,
    "profile": "none",
    "met_s": 1.0,
    "messages": 20,
    "got": 0,
    "twice": 0,
}


@pytest.fixture
def robots() -> ModuleType:
    return importlib.import_module("figure_topics.robots")


def measured(topics: ModuleType, name: str, raw: Any) -> dict[str, str]:
    (topic,) = (topic for topic in topics.TOPICS if topic.name == name)
    return {row.key: row.measured(row.taken(raw)) for row in topic.rows}


def wifi(**changes: Any) -> dict[str, Any]:
    came = {"got": 20, "age_p50_s": 0.99, "age_p95_s": 2.434, "sender_kb_s": 96.4, "receiver_kb_s": 1.8}
    return {**RUN, "profile": WIFI, **came, **changes}


def test_a_team_is_summed_over_its_robots(robots: ModuleType) -> None:
    run = {
        "robots": {"r1": {"searched": 10, "sent": 12}, "r2": {"searched": 9, "sent": 9}},
        "ms": {"wait": [23012.0, 36000.0], "search": [300.0, 611.0]},
        "percent": {"registrar": 87.6, "r1/keyframer": 9.1, "r2/keyframer": 11.7, "r1/drive": 50.0},
        "closures": 44,
        "between": 25,
        "false": 0,
    }
    assert measured(robots, "team", [run]) == {
        "search": "19 of 21; 23.01 s (p95 36.00); 0.30 s (p95 0.61)",
        "usage": "88 % of a core; 12 %",
        "constraints": "44, 25 between robots, 0 false",
    }


def test_each_profile_has_what_came_and_a_size_without_pauses_says_so(robots: ModuleType) -> None:
    raw = [RUN, wifi(twice=1), wifi(peers=True, sender_kb_s=290.2, got=19)]
    assert measured(robots, "wireless", raw) == {
        "lost": "none 0 of 20; fastdds_wifi.xml 20 of 20, 0.99 s (p95 2.43); 1 twice",
        "pause": "not in this size",
        "peers": "98, 292 kB/s; 19 of 20, 0.99 s (p95 2.43)",
    }
    paused = measured(robots, "wireless", [*raw, {**RUN, "pause_s": 30.0, "met_s": None}])["pause"]
    assert paused == "none never met; 0 twice"


def test_what_a_machine_lacks_leaves_the_topic_out(
    robots: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("os.geteuid", lambda: 1000)
    (wireless,) = (topic for topic in robots.TOPICS if topic.name == "wireless")
    assert "expected to run as root" in wireless.lacks("quick", tmp_path)
    assert replace(wireless, lack=lambda: None).lacks("quick", tmp_path) == ""


def test_the_founding_tables_stand_beside_ours_with_the_true_error() -> None:
    founding = importlib.import_module("figure_topics.founding")
    found = {"success": 1.0, "error_m": 0.0026, "rotation_deg": 0.37, "translation_cm": 0.12}
    none = {"success": 0.0, "error_m": None, "rotation_deg": None, "translation_cm": None}
    cells = [{"object": name, "document_m": 0.2563, "founding": none, "ours": found} for name in founding.OBJECTS]
    raw = {
        "table_1": cells,
        "table_2": {"soda_can": [cells[0], {**cells[0], "ours": none}]},
        "by_angle": {"0-30": {"ours": 1.0, "founding": 0.5}},
        "time": {"ours_cpu_ms": 2.64, "ratio_paper_cpu_ms": 757.4},
    }
    rows = measured(founding, "paper", raw)
    assert rows["table_1_cap"] == "stated 256; its ICP none; ours 2.6 (0.4°, 0.1 cm)"
    assert rows["table_2"] == "soda can: its ICP 0.00, ours 0.50"
    assert rows["right"] == "1.00 at 0-30°; its ICP 0.50" and rows["time"] == "2.6 ms, 757 × faster"
