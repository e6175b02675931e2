# SPDX-License-Identifier: Apache-2.0
"""Topics about several robots that run live, and about what they send over the air. They need ROS 2."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from hosts import lack

from figure_topics.topic import Row, Topic, Values

LOSS = 0.2  # of the frames
WIFI = "config/fastdds_wifi.xml"


def _team(raw: Any) -> Values:
    run = raw[0]
    keyframers = [run["percent"][f"{robot}/keyframer"] for robot in run["robots"]]
    counted = {key: sum(row[key] for row in run["robots"].values()) for key in ("searched", "sent")}
    seconds = {
        name if rank == 0 else f"{name}_p95": f"{run['ms'][name][rank] / 1000:.2f}"
        for name in ("wait", "search")
        for rank in (0, 1)
    }
    return {
        **counted,
        **seconds,
        **{key: run[key] for key in ("closures", "between", "false")},
        "registrar": round(run["percent"]["registrar"]),
        "keyframer": round(max(keyframers)),
    }


def _ended(row: Any) -> str:
    """What came of the messages of a run, and how old."""
    if row["met_s"] is None:
        return "never met"
    came = f"{row['got']} of {row['messages']}"
    return came + (f", {row['age_p50_s']:.2f} s (p95 {row['age_p95_s']:.2f})" if row["got"] else "")


def _air(raw: Any, pause_s: float) -> Values:
    rows = [row for row in raw if (row["loss"], row["pause_s"], row["peers"]) == (LOSS, pause_s, False)]
    ends = "; ".join(f"{Path(row['profile']).name} {_ended(row)}" for row in rows)
    return {"came": f"{ends}; {sum(row['twice'] for row in rows)} twice" if rows else "not in this size"}


def _peers(raw: Any) -> Values:
    rows = {row["peers"]: row for row in raw if (row["loss"], row["pause_s"], row["profile"]) == (LOSS, 0.0, WIFI)}
    sent = {peers: row["sender_kb_s"] + row["receiver_kb_s"] for peers, row in rows.items()}
    return {"multicast": round(sent[False]), "peers": round(sent[True]), "came": _ended(rows[True])}


TOPICS = (
    Topic(
        name="team",
        title="Three robots live",
        script="benchmarks/team.py --keep KEEP",
        quick="--simulate 1 --frames 30 --rate 2",
        whole="--simulate 1 --frames 150",
        minutes=(0.8, 15),
        rows=(
            Row("constraints", "constraints", "{closures}, {between} between robots, {false} false", _team),
            Row(
                "search",
                "searched; wait; search",
                "{searched} of {sent}; {wait} s (p95 {wait_p95}); {search} s (p95 {search_p95})",
                _team,
                timed=True,
            ),
            Row("usage", "registrar; busiest keyframer", "{registrar} % of a core; {keyframer} %", _team, timed=True),
        ),
        alone=True,
    ),
    Topic(
        name="wireless",
        title="A fifth of all frames lost",
        script="benchmarks/wireless.py --rmw rmw_fastrtps_cpp --peers",
        quick="--trouble 0.2:0 --messages 15 --linger 10",
        whole="--trouble 0.2:0 --trouble 0.2:30 --messages 45",
        minutes=(0.6, 5),
        rows=(
            Row("lost", "came", "{came}", partial(_air, pause_s=0.0), timed=True),
            Row("pause", "pause of 30 s", "{came}", partial(_air, pause_s=30.0)),
            Row("peers", "sent; static peers", "{multicast}, {peers} kB/s; {came}", _peers, timed=True),
        ),
        alone=True,
        lack=lack,
    ),
)
