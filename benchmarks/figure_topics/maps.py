# SPDX-License-Identifier: Apache-2.0
"""Topics about a map that is lived with: taken elsewhere, places alike, stores merged, labels for training."""

from __future__ import annotations

from typing import Any

from figure_topics.topic import Row, Topic, Values

SURE = 0.99  # the stated probability from which on a pose counts as sure


def _kidnapped(raw: Any) -> Values:
    total = raw["total"]
    return {
        "in_time": total["in_time"],
        "counted": total["counted"],
        "alarms": total["false_alarms"],
        "seconds": round(3600 * total["normal_hours"]),
    }


def _sure(raw: Any) -> Values:
    bins = [row for row in raw["total"]["reliability"] if row["from"] >= SURE]
    answers = sum(row["answers"] for row in bins)
    return {"answers": answers, "right": round(sum(row["answers"] * row["right"] for row in bins))}


def _twins(raw: Any) -> Values:
    total = raw["total"]
    return {**{key: total[key] for key in ("false", "constraints", "known", "saw")}, **_forced(total["forced"])}


def _forced(total: Any) -> Values:
    return {"forced_false": total["false"], "tried": total["tried"], "by_gate": total["accepted"]}


def _merged(raw: Any) -> Values:
    buildings = [row for row in raw.values() if isinstance(row, dict) and "merged" in row]
    both = raw.get("both", {}).get("both buildings")
    return {
        "merged": sum(row["merged"]["between"] for row in buildings),
        "one": sum(row["one registrar"]["between"] for row in buildings),
        "false": sum(row["merged"]["false"] for row in buildings),
        "map": ", ".join(f"{row['merged']['map_cm']:.2f}" for row in buildings if row["merged"]["map_cm"]),
        "across": "not tried" if both is None else both["between"],
    }


def _labels(raw: Any) -> Values:
    rows = list(raw.values())
    lowest = {key: min(row[key] for row in rows) for key in ("recall", "recall_known", "iou_box", "iou_mask")}
    precision = min(row["precision"]["all"] for row in rows)
    return {key: f"{value:.2f}" for key, value in (lowest | {"precision": precision}).items()}


KIDNAPPINGS = (
    Row(
        "found",
        "kidnappings that are noticed within 3 s of two known objects; false alarms",
        "{in_time} of {counted}; {alarms} in {seconds} s",
        _kidnapped,
    ),
    Row("sure", "stated as 0.99 and more likely within 0.5 m, and so", "{right} of {answers}", _sure),
)
TOPICS = (
    Topic(
        name="localisation",
        title="Taken elsewhere",
        script="benchmarks/localisation.py --model truth --seed 1 --keep KEEP",
        quick="--simulate loop:95 --frames 160 --kidnappings 1",
        whole="--simulate moved:96 --simulate loop:95,98 --frames 300 --kidnappings 4",
        minutes=(1.1, 14),
        rows=KIDNAPPINGS,
        about="A camera is carried elsewhere at random, in a session of its own and upon an earlier map.",
    ),
    Topic(
        name="localisation_real",
        title="Taken elsewhere, real recordings",
        script="benchmarks/localisation.py --seed 1 --model COCO --threshold 0.4 --keep KEEP",
        quick="RPY --kidnappings 1",
        whole="KITCHEN RPY --kidnappings 10",
        minutes=(2.3, 17),
        rows=KIDNAPPINGS,
        about="Cut and spliced at random.",
    ),
    Topic(
        name="twins",
        title="Two places that are alike but for one thing",
        script="benchmarks/twins.py --keep KEEP",
        quick="--seeds 103 --frames 160 --tries 10",
        whole="--seeds 103,104,105 --frames 240 --tries 100",
        minutes=(1, 4),
        rows=(
            Row(
                "sessions",
                "false constraints of later sessions; place known where the difference was seen",
                "{false} of {constraints}; {known} of {saw}",
                _twins,
            ),
            Row(
                "forced",
                "keyframes forced upon the twin, false; those that the gate alone accepts",
                "{forced_false} of {tried}; {by_gate}",
                _twins,
            ),
        ),
    ),
    Topic(
        name="merge",
        title="Stores merged",
        script="benchmarks/merge.py --keep KEEP",
        quick="--seeds 1 --frames 60",
        whole="--seeds 1,2 --frames 200",
        minutes=(1.8, 15),
        rows=(
            Row(
                "between",
                "closures between robots that `objreg merge` finds; what one registrar of all three finds",
                "{merged}, {false} false; {one}",
                _merged,
            ),
            Row("map", "error of the merged map", "{map} cm", _merged),
            Row("across", "closures between two buildings", "{across}", _merged),
        ),
    ),
    Topic(
        name="labels",
        title="Labels for training",
        script="benchmarks/labels.py --seed 74",
        quick="--frames 60",
        whole="--frames 240",
        minutes=(0.8, 2),
        rows=(
            Row(
                "right",
                "precision, recall and IoU of exported boxes, lowest of three recordings",
                "{precision}, {recall} and {iou_box}",
                _labels,
            ),
        ),
    ),
)
