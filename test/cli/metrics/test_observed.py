# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import time

import pytest

from objreg_ros.bridge.node.accounting import Balance
from objreg_tools.cli.metrics.observed import MOST_NODES, Observed
from objreg_tools.cli.watching.reports import NodeReport

COUNTERS = Balance(10, 6, 1, {}, {})


def report(closures: str | None, ago_s: float = 0.0) -> NodeReport:
    counts = {} if closures is None else {"constraints": closures}
    return NodeReport(COUNTERS, False, "", {}, counts, at_s=time.monotonic() - ago_s)


def since_s(*reports: NodeReport) -> float | None:
    observed = Observed()
    for one in reports:
        observed.report("/registrar", one)
    return observed.nodes()["/registrar"].since_closure_s()


def test_time_runs_from_the_report_in_which_closures_grew() -> None:
    since = since_s(report("0", 9.0), report("1", 7.0), report("1", 1.0))
    assert since == pytest.approx(7.0, abs=0.5)


@pytest.mark.parametrize("closures", ["0", "5", None])
def test_before_the_first_closure_that_was_seen_there_is_no_time(closures: str | None) -> None:
    assert since_s(report(closures, 2.0), report(closures)) is None


def test_a_registrar_that_began_anew_has_closed_once_it_counts_again() -> None:
    assert since_s(report("5", 9.0), report("0", 5.0)) is None
    assert since_s(report("5", 9.0), report("2", 5.0)) == pytest.approx(5.0, abs=0.5)
    assert since_s(report("5", 9.0), report("6", 8.0), report("0", 1.0)) == pytest.approx(8.0, abs=0.5)


def test_a_number_of_closures_that_is_none_is_refused_and_changes_nothing() -> None:
    observed = Observed()
    observed.report("/registrar", report("3"))
    for node in ("/registrar", "/other"):
        with pytest.raises(ValueError):
            observed.report(node, report("many"))
    assert [known.closures for known in observed.nodes().values()] == [3]


def test_any_number_of_names_takes_bounded_memory() -> None:
    observed = Observed()
    for k in range(MOST_NODES + 50):
        observed.report(f"/node{k}", report(None))
    assert len(observed.nodes()) == MOST_NODES
