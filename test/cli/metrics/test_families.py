# SPDX-License-Identifier: Apache-2.0
"""The declared metrics: their names, their numbers, and who else names them."""

from __future__ import annotations

import json
import re
import time
from pathlib import Path
from typing import Any

import pytest

from objreg_ros.bridge.node.accounting import Balance
from objreg_tools.cli.metrics.families import FAMILIES
from objreg_tools.cli.metrics.observed import Observation
from objreg_tools.cli.watching.reports import NodeReport

BALANCE = Balance(10, 6, 1, {"overtaken": 3}, {"/image": 2}, {"total": (10.0, 20.0), "search": (2.0, 4.0)})
NAMES = {family.name for family in FAMILIES}
METRIC = re.compile(r"\bobjreg_\w+")


@pytest.fixture(scope="module")
def dashboard(repository: Path) -> dict[str, Any]:
    return json.loads((repository / "config/grafana.json").read_text(encoding="utf-8"))


def samples(report: NodeReport) -> dict[str, list[tuple[tuple[str, ...], float]]]:
    return {family.name: made for family in FAMILIES if (made := list(family.of(Observation(report))))}


def test_names_follow_prometheus_rules() -> None:
    assert len(NAMES) == len(FAMILIES)
    for family in FAMILIES:
        assert re.fullmatch(r"objreg_[a-z][a-z0-9]*(_[a-z0-9]+)*", family.name) and family.doc.endswith(".")
        assert not re.search(r"_(ms|milliseconds|count|sum|bucket|info|created)$", family.name)
        assert all(re.fullmatch(r"[a-z_]+", label) and label not in ("le", "quantile") for label in family.labels)
        made = family.samples(Observation(NodeReport(BALANCE, True, "")))
        assert {len(labels) for labels, _ in made} <= {len(family.labels)}


def test_each_number_of_a_report_has_its_metric() -> None:
    seen = samples(NodeReport(BALANCE, True, "", {"no_candidate": 7}, {"constraints": "4"}, ("wrong-camera",)))
    assert seen["objreg_closures_total"] == [((), 4)]
    assert seen["objreg_refusals_total"] == [(("no_candidate",), 7)]
    assert seen["objreg_frames_received_total"] == [((), 10)] and seen["objreg_frames_published_total"] == [((), 6)]
    assert seen["objreg_frames_dropped_total"] == [(("overtaken",), 3)] and seen["objreg_frames_waiting"] == [((), 1)]
    assert seen["objreg_messages_lost_total"] == [(("/image",), 2)]
    assert seen["objreg_latency_p50_seconds"] == [(("search",), 0.002), (("total",), 0.01)]
    assert seen["objreg_latency_p95_seconds"] == [(("search",), 0.004), (("total",), 0.02)]
    assert seen["objreg_stream_doubted"] == [((), 1)] and seen["objreg_stream_finding"] == [(("wrong-camera",), 1)]
    assert seen["objreg_node_up"] == seen["objreg_node_warns"] == [((), 1)]


def test_a_node_that_closes_no_loops_has_no_closures_and_is_not_doubted() -> None:
    seen = samples(NodeReport(BALANCE, False, ""))
    assert seen["objreg_stream_doubted"] == [((), 0)] and "objreg_stream_finding" not in seen
    assert not {"objreg_closures_total", "objreg_refusals_total", "objreg_since_last_closure_seconds"} & set(seen)


def test_of_a_silent_node_only_its_counters_are_left_and_that_it_is_not_up() -> None:
    seen = samples(NodeReport(BALANCE, False, "", at_s=time.monotonic() - 60.0))
    assert seen["objreg_node_up"] == [((), 0)]
    assert all(name.endswith("_total") for name in seen if name != "objreg_node_up")


def test_the_dashboard_names_only_metrics_and_labels_that_exist(dashboard: dict[str, Any]) -> None:
    labels = {family.name: {"node", *family.labels} for family in FAMILIES}
    shown: set[str] = set()
    for panel in dashboard["panels"]:
        for target in panel["targets"]:
            (name,) = METRIC.findall(target["expr"])
            used = re.findall(r'(\w+)(?:=|!=)~?"', target["expr"]) + re.findall(r"{{(\w+)}}", target["legendFormat"])
            assert name in NAMES and set(used) <= labels[name], target
            shown.add(name)
    assert shown == NAMES
    queries = [variable["query"] for variable in dashboard["templating"]["list"] if variable["type"] == "query"]
    assert queries and all(set(METRIC.findall(query["query"])) <= NAMES for query in queries)


def test_a_value_of_0_or_1_is_shown_as_what_it_means(dashboard: dict[str, Any]) -> None:
    texts = {
        panel["title"]: {value: shown["text"] for value, shown in mapping["options"].items()}
        for panel in dashboard["panels"]
        for mapping in panel["fieldConfig"]["defaults"].get("mappings", ())
    }
    assert texts == {"Nodes": {"0": "silent", "1": "up"}, "Streams": {"0": "as stated", "1": "doubted"}}


def test_the_panels_of_the_dashboard_have_their_own_places(dashboard: dict[str, Any]) -> None:
    panels = dashboard["panels"]
    cells = [
        (x, y)
        for at in (panel["gridPos"] for panel in panels)
        for x in range(at["x"], at["x"] + at["w"])
        for y in range(at["y"], at["y"] + at["h"])
    ]
    assert len(cells) == len(set(cells)) and max(x for x, _ in cells) < 24
    assert len({panel["id"] for panel in panels}) == len({panel["title"] for panel in panels}) == len(panels)


def test_the_documentation_names_every_metric_and_no_other(repository: Path) -> None:
    page = (repository / "docs/diagnostics.md").read_text(encoding="utf-8")
    section = page.partition("## Prometheus and Grafana")[2].partition("\n## ")[0]
    assert set(METRIC.findall(section)) - {"objreg_ros"} == NAMES
