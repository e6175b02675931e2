# SPDX-License-Identifier: Apache-2.0
"""Made-up diagnostics to the text that a scraper reads, and back by the client's own parsers."""

from __future__ import annotations

import sys
import time

import pytest
from prometheus_client.openmetrics.parser import text_string_to_metric_families as parse_open
from prometheus_client.parser import text_string_to_metric_families as parse_plain

from objreg_ros.bridge.node.accounting import Balance
from objreg_tools.cli.metrics.exposition import OPEN_METRICS, Exposition
from objreg_tools.cli.metrics.observed import Observed
from objreg_tools.cli.watching.reports import NodeReport

BALANCE = Balance(10, 6, 1, {"overtaken": 3}, {}, {"total": (10.0, 20.0)})


def text(observed: Observed, accept: str = "") -> str:
    answer = Exposition(observed).pages("/metrics", accept)
    assert answer is not None
    return answer.body.decode()


@pytest.fixture
def observed() -> Observed:
    made = Observed()
    made.report("/detector", NodeReport(BALANCE, False, ""))
    for closures, ago_s in (("3", 9.0), ("4", 2.0)):
        made.report("/robot1/registrar", NodeReport(
            BALANCE, True, "off", {"no_candidate": 7}, {"constraints": closures}, ("wrong-camera",),
            at_s=time.monotonic() - ago_s))  # fmt: skip
    return made


def test_the_text_of_a_graph_is_known(observed: Observed) -> None:
    lines = text(observed).splitlines()
    for line in (
        "# HELP objreg_closures_total Loop closures that were published.",
        "# TYPE objreg_closures_total counter",
        'objreg_closures_total{node="/robot1/registrar"} 4.0',
        'objreg_refusals_total{node="/robot1/registrar",reason="no_candidate"} 7.0',
        'objreg_frames_received_total{node="/detector"} 10.0',
        'objreg_frames_published_total{node="/detector"} 6.0',
        'objreg_frames_dropped_total{node="/detector",reason="overtaken"} 3.0',
        "# TYPE objreg_latency_p95_seconds gauge",
        'objreg_latency_p50_seconds{node="/detector",stage="total"} 0.01',
        'objreg_latency_p95_seconds{node="/detector",stage="total"} 0.02',
        'objreg_stream_doubted{node="/detector"} 0.0',
        'objreg_stream_doubted{node="/robot1/registrar"} 1.0',
        'objreg_stream_finding{finding="wrong-camera",node="/robot1/registrar"} 1.0',
    ):
        assert line in lines, line
    (since,) = [line for line in lines if line.startswith("objreg_since_last_closure_seconds{")]
    assert float(since.split()[-1]) == pytest.approx(2.0, abs=1.0)


def test_who_asks_for_openmetrics_gets_it_with_units_and_its_end(observed: Observed) -> None:
    answer = Exposition(observed).pages("/metrics", f"{OPEN_METRICS};version=1.0.0,text/plain;q=0.5")
    assert answer is not None and answer.kind.startswith(OPEN_METRICS)
    body = answer.body.decode()
    assert body.endswith("# EOF\n") and "# UNIT objreg_latency_p50_seconds seconds\n" in body
    opened = {family.name: family for family in parse_open(body)}
    assert opened["objreg_closures"].type == "counter" and opened["objreg_frames_waiting"].type == "gauge"
    assert {f.name.removesuffix("_total") for f in parse_plain(text(observed))} == set(opened)


def test_without_nodes_there_are_no_metrics() -> None:
    assert text(Observed()) == "" and text(Observed(), OPEN_METRICS) == "# EOF\n"


def test_labels_of_other_nodes_are_escaped_and_cut(observed: Observed) -> None:
    name = '/a"b\\c\nd' + "x" * 10_000
    observed.report(name, NodeReport(BALANCE, False, ""))
    (family,) = [f for f in parse_open(text(observed, OPEN_METRICS)) if f.name == "objreg_node_up"]
    assert name[:300] in {sample.labels["node"] for sample in family.samples}


def test_there_is_no_other_page(observed: Observed) -> None:
    assert Exposition(observed).pages("/", "") is None


def test_without_the_client_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "prometheus_client", None)
    with pytest.raises(ValueError, match=r"objreg metrics: expected prometheus_client, got none; .*\[metrics\]"):
        Exposition(Observed())


def test_nonsense_of_one_node_leaves_the_others_as_they_are(observed: Observed) -> None:
    before = text(observed).splitlines()
    long = {"x" * 300 + end: 1 for end in "ab"}  # the same once they are cut
    observed.report("/mad", NodeReport(Balance(10**400, 6, 1, long, {}, {"total": (float("nan"), 1.0)}), False, ""))
    after = text(observed).splitlines()
    mad = [line for line in after if 'node="/mad"' in line]
    assert len([line for line in mad if "dropped_total{" in line]) == 1
    assert not [line for line in mad if "received_total{" in line or "p50_seconds{" in line]
    stays = [line for line in before if 'node="/detector"' in line]
    assert stays and set(stays) <= set(after)
