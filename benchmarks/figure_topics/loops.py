# SPDX-License-Identifier: Apache-2.0
"""Topics about whole recordings: revisits that are closed, sessions, robots, and faults of the stream."""

from __future__ import annotations

from typing import Any

from figure_topics.topic import Row, Topic, Values

OURS = "objreg"  # as closure.py names it


def _closed(raw: Any) -> Values:
    ours = raw["total"][OURS]
    return {**{key: ours[key] for key in ("constraints", "true", "false")}, **ours["recall"]["all"]}


def _path(raw: Any) -> Values:
    each = [row["methods"][OURS]["ate_cm"] for row in raw["recordings"].values()]
    return {"path": "; ".join(f"{ate['before']:.1f} → {ate['after']:.1f} cm" for ate in each)}


LOOPS = (
    Row(
        "closed",
        "revisits closed; constraints within 5° and 10 cm, beyond 8° or 15 cm",
        "{closed} of {of} closed; {constraints} constraints, {true} right, {false} false",
        _closed,
    ),
    Row("path", "error of each trajectory, by odometry and corrected", "{path}", _path),
)
REAL = "benchmarks/closure.py --seed 1 --keep KEEP --peers ''"


def _robots(raw: Any) -> Values:
    rows = [row["one registrar"] for row in raw.values()]
    between = [row["between"] for row in rows]
    return {
        "constraints": sum(row["constraints"] for row in rows),
        "false": sum(row["false"] for row in rows),
        "between": sum(row["constraints"] for row in between),
        "closed": sum(row["stretches"]["closed"] for row in between),
        "of": sum(row["stretches"]["of"] for row in between),
        "map": ", ".join("-" if row["map_cm"] is None else f"{row['map_cm']:.1f}" for row in rows),
    }


def _rooms(raw: Any) -> Values:
    rows = [row for by_store in raw.values() for name, row in by_store.items() if name != "none"]
    return {
        "found": sum(row["found"] for row in rows),
        "could": sum(row["could_close"] for row in rows),
        "others": sum(row["with_other_rooms"] for row in rows),
        "constraints": sum(row["constraints"] for row in rows),
    }


def _faults(raw: Any) -> Values:
    total = raw["faults"]["total"]
    return {key: total[key] for key in ("false", "cases", "named", "losing", "right_with_cause", "right_cases")}


TOPICS = (
    Topic(
        name="loops_real",
        title="Loops of two real recordings",
        script=REAL,
        quick="RPY --model COCO --threshold 0.4",
        whole="KITCHEN RPY --model COCO --threshold 0.4",
        minutes=(1.1, 2),
        rows=LOOPS,
        about="With odometry that drifts by 2 % and 1° a metre.",
    ),
    Topic(
        name="loops_unnamed",
        title="The same without a detector",
        script=REAL,
        quick="RPY --model nothing",
        whole="KITCHEN RPY --model nothing",
        minutes=(1, 2),
        rows=LOOPS,
        about="What stands apart is an object.",
    ),
    Topic(
        name="loops_simulated",
        title="Simulated loops",
        script=REAL,
        quick="--simulate loop:9941 --frames 120",
        whole="--simulate moved:9944 --simulate opposite:9942 --simulate look-alikes:9943 --frames 240",
        minutes=(0.8, 3),
        rows=LOOPS,
    ),
    Topic(
        name="jitter",
        title="Odometry that jitters by 3° and 4 cm",
        script=f"{REAL} --jitter 3,4",
        quick="RPY --model COCO --threshold 0.4",
        whole="KITCHEN RPY --model COCO --threshold 0.4",
        minutes=(1.5, 2),
        rows=LOOPS[:1],
    ),
    Topic(
        name="relocalisation",
        title="Where a robot woke up",
        script="benchmarks/relocalisation.py --seed 1 --keep KEEP",
        quick="--simulate loop:0 --frames 160 --starts 2",
        whole="--simulate moved:1,2,3 --simulate loop:0,1 --simulate look-alikes:0 --frames 240 --starts 3",
        minutes=(0.7, 4),
        rows=(
            Row(
                "found",
                "sessions that know where they are within 5 s of a known object",
                "{in_time} of {could}, after {median_s} s (median)",
                lambda raw: {key: raw["total"][key] for key in ("in_time", "could", "median_s")},
            ),
            Row(
                "false",
                "first answers beyond 8° or 15 cm",
                "{false_sessions} of {sessions}",
                lambda raw: {key: raw["total"][key] for key in ("false_sessions", "sessions")},
            ),
        ),
        about="A later session begins anywhere in a place that an earlier one stored.",
    ),
    Topic(
        name="days",
        title="The next day",
        script="benchmarks/relocalisation.py --seed 1 --days --keep KEEP",
        quick="RPY --model COCO --threshold 0.4",
        whole="KITCHEN RPY --model COCO --threshold 0.4 --simulate days:100,101",
        minutes=(0.8, 5),
        rows=(
            Row(
                "near",
                "keyframes that show two stored objects and are known within 0.5 m; within 5 cm and 3°",
                "{near} and {strict} of {could}",
                lambda raw: {key: raw["total"][key] for key in ("near", "strict", "could")},
            ),
            Row(
                "wrong",
                "answers beyond 8° or 15 cm; closures",
                "{wrong} of {answers}; {wrong_closures} of {closures}",
                lambda raw: {key: raw["total"][key] for key in ("wrong", "answers", "wrong_closures", "closures")},
            ),
        ),
        about="The second half of each recording is one session upon the map of the first; in the simulated ones a "
        "third of all things stand elsewhere by then. An answer is a closure, or an earlier one and odometry.",
    ),
    Topic(
        name="rooms",
        title="Beside other rooms in the store",
        script="benchmarks/rooms.py --seed 1 --keep KEEP",
        quick="--rooms 2 --frames 60 --simulate loop:61000",
        whole="KITCHEN RPY --rooms 10 --simulate moved:9709",
        minutes=(0.6, 3),
        rows=(
            Row("found", "keyframes that could close for which their place is tried", "{found} of {could}", _rooms),
            Row("others", "constraints with another room", "{others} of {constraints}", _rooms),
        ),
    ),
    Topic(
        name="robots",
        title="Three robots, one registrar",
        script="benchmarks/robots.py --keep KEEP --ways 'one registrar'",
        quick="--simulate 1 --frames 80",
        whole="--simulate 1,2 --frames 200",
        minutes=(1.6, 5),
        rows=(
            Row(
                "constraints",
                "constraints of three simulated robots",
                "{constraints}, {between} between robots, {false} false",
                _robots,
            ),
            Row(
                "met", "stretches where two met that are tied; error of the map", "{closed} of {of}; {map} cm", _robots
            ),
        ),
    ),
    Topic(
        name="streams",
        title="Recordings that are wrong about themselves",
        script="benchmarks/streams.py KITCHEN RPY --model COCO --threshold 0.4 --seed 1000 --keep KEEP",
        quick="--simulate '' --cases 8 --frames 60",
        whole="--cases 48 --frames 100",
        minutes=(1, 14),
        rows=(
            Row("false", "false constraints", "{false} in {cases} cases", _faults),
            Row("named", "cause named, of cases that lose closures", "{named} of {losing}", _faults),
            Row("alarms", "a cause found in a right recording", "{right_with_cause} of {right_cases}", _faults),
        ),
    ),
)
