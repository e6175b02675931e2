# SPDX-License-Identifier: Apache-2.0
"""The table at the end of a live run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from objreg_ros.bridge.node.accounting import Balance
from objreg_tools.cli.live import STAGES, Live
from objreg_tools.report.stage_times import in_order


def lines(live: Live, sent: Mapping[str, int], truth: Mapping[str, Any]) -> Iterator[str]:
    """The table, line by line.

    ``sent`` is how many frames were sent to each node, ``truth`` as `objreg_tools.truth.summarise` gives it.
    """
    yield f"{'frames':<12}{'sent':>7}{'in':>7}{'out':>7}{'waiting':>9}  dropped"
    for node in STAGES:
        yield _frames(node, sent[node], live.counters[node])
    yield ""
    yield f"{'latency':<12}{'stage':<18}{'p50 ms':>9}{'p95 ms':>9}"
    for node in STAGES:
        yield from _latencies(node, live.counters[node])
    yield ""
    yield f"constraints: {len(live.closures)}"
    yield f"rejected: {_counts(live.rejected)}"
    yield _errors(truth)


def _frames(node: str, sent: int, counters: Balance) -> str:
    dropped = dict(counters.dropped)
    if sent > counters.received:
        dropped["lost on the way"] = sent - counters.received
    return f"{node:<12}{sent:>7}{counters.received:>7}{counters.published:>7}{counters.waiting:>9}  {_counts(dropped)}"


def _counts(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {reason}" for reason, count in sorted(counts.items())) or "–"


def _latencies(node: str, counters: Balance) -> Iterator[str]:
    for part, stage, (p50, p95) in in_order(counters.stage_ms):
        yield f"{node:<12}{f'{stage}{part}':<18}{p50:>9.1f}{p95:>9.1f}"


def _errors(truth: Mapping[str, Any]) -> str:
    if not truth["count"]:
        return "true error: no constraint, or no ground truth"
    degrees, centimetres = truth["rotation_deg"], truth["translation_cm"]
    return (
        f"true error: {degrees['median']:.2f}° {centimetres['median']:.1f} cm median, "
        f"{degrees['max']:.2f}° {centimetres['max']:.1f} cm at most; of {truth['count']} constraints "
        f"{truth['strict']} within 3° and 5 cm, {truth['loose']} within 5° and 10 cm, {truth['false']} false"
    )


def require_balance(live: Live, sent: Mapping[str, int]) -> None:
    """ValueError if a node received more than was sent to it, or if in is not out + waiting + dropped."""
    for node in STAGES:
        counters = live.counters[node]
        ended = counters.published + counters.waiting + sum(counters.dropped.values())
        if counters.received != ended or counters.received > sent[node]:
            raise ValueError(
                f"{node}: expected in = out + waiting + dropped and no more than the {sent[node]} that were sent, "
                f"got {counters.received} in and {ended} accounted for"
            )
