# SPDX-License-Identifier: Apache-2.0
"""Topics about two keyframes: what is right, accepted and false."""

from __future__ import annotations

from functools import partial
from typing import Any

from figure_topics.topic import Row, Topic, Values

CONDITIONS = ("clean", "stress")


def _ours(raw: Any) -> Values:
    ours = raw["methods"]["ours"]
    return {
        "accepted": round(ours["accepted_recall"] * ours["could_close"]),
        "could": ours["could_close"],
        "wrong": ours["wrong"],
        "of": ours["tried"],
        "ms": round(ours["ms_p50"]),
        "cm": round(ours["translation_cm"], 1),
        "deg": round(ours["rotation_deg"], 1),
    }


def _peers(raw: Any) -> Values:
    rows = [(name, row) for name, row in raw["methods"].items() if name != "ours"]
    one = "{}: {:.2f} accepted, {} wrong, {:.0f} ms"
    said = [one.format(name, row["accepted_recall"], row["wrong"], row["ms_p50"]) for name, row in rows]
    return {"peers": "; ".join(said)}


REAL_PAIRS = (
    Row(
        "accepted",
        "right and accepted, of the pairs that could close",
        "{accepted} of {could} accepted, {wrong} of {of} wrong, {ms} ms a pair",
        _ours,
        timed=True,
    ),
    Row("error", "error of what is right, median", "{deg}°, {cm} cm", _ours),
    Row("peers", "the usual methods on the same pairs", "{peers}", _peers, timed=True),
)


def _both(raw: Any, key: str) -> Values:
    return {condition: round(raw[condition][key], 3) for condition in CONDITIONS}


def _false(raw: Any) -> Values:
    rows = [raw[condition] for condition in CONDITIONS]
    return {"false": sum(row["false_accepted"] for row in rows), "tried": sum(row["tried"] for row in rows)}


def _total(raw: Any) -> Values:
    total = raw["total"]
    return {"tried": total["tried"], **{key: total["all"][key] for key in ("count", "loose", "false")}}


def _refused(raw: Any) -> Values:
    total = raw["total"]
    refused = sum(total["refused_though_right"].values())
    return {"refused": refused, "right": refused + total["all"]["loose"]}


def _at(raw: Any, least: int) -> Values:
    row = next(row for row in raw if row["odds"] == least)
    return {key: row[key] for key in ("accepted", "false", "predicted", "recall")}


TOPICS = (
    Topic(
        name="pairs_rpy",
        title="Pairs of real frames, fast turns",
        script="benchmarks/pairs.py RPY --model COCO --threshold 0.4 --lag-ms 30 --seed 1",
        quick="--wanted 25 --peers orb_pnp",
        whole="--wanted 100",
        minutes=(0.6, 10),
        rows=REAL_PAIRS,
        about="Half of the pairs could close. Wrong is at the stamps.",
    ),
    Topic(
        name="pairs_kitchen",
        title="Pairs of real frames, a room",
        script="benchmarks/pairs.py KITCHEN --model COCO --seed 19",
        quick="--wanted 25 --peers orb_pnp",
        whole="--wanted 100",
        minutes=(0.5, 8),
        rows=REAL_PAIRS,
    ),
    Topic(
        name="strangers",
        title="Keyframes of different places",
        script="benchmarks/strangers.py KITCHEN RPY --model COCO --threshold 0.4 --frames 80 --seed 1",
        quick="--pairs 300",
        whole="--pairs 10000 --simulate moved:811 --simulate loop:814:sensor=realsense_d435",
        minutes=(0.8, 13),
        rows=(
            Row(
                "accepted",
                "pairs that share a label, and no place, accepted",
                "{accepted} of {pairs}",
                lambda raw: {"accepted": len(raw["accepted"]), "pairs": raw["pairs"]},
            ),
        ),
    ),
    Topic(
        name="registration",
        title="One object upon another, any angle",
        script="benchmarks/registration.py --seed 9521",
        quick="--quick",
        whole="--reps 1 --negatives 60 --every 180",
        minutes=(0.8, 3),
        rows=(
            Row(
                "right", "right within 5° and 2 cm", "{clean}; with stress {stress}", lambda raw: _both(raw, "success")
            ),
            Row("recall", "of what is right accepted", "{clean}; {stress}", lambda raw: _both(raw, "recall_accepted")),
            Row("false", "false of all that were tried", "{false} of {tried}", _false),
        ),
        about="Simulated, clean and with stress: occluders, ragged silhouettes, bias and warp of depth.",
    ),
    Topic(
        name="false_closures",
        title="Every keyframe against ten others",
        script="benchmarks/false_closures.py --keep KEEP",
        quick="--frames 60 --simulate moved:1306:qvga:stress --simulate look-alikes:1310:qvga:stress",
        whole="--first-seed 2100 --recordings 26",
        minutes=(1.2, 50),
        rows=(
            Row(
                "false",
                "beyond 8° or 15 cm of what was accepted",
                "{false} of {count}; {tried} pairs tried, {loose} within 5° and 10 cm",
                _total,
            ),
            Row("refused", "right poses that are refused", "{refused} of {right}", _refused),
        ),
    ),
    Topic(
        name="odds",
        title="The odds of the gate",
        script="training/likelihood.py fresh --first-seed 20100 --keep KEEP",
        quick="--every 36",
        whole="",
        minutes=(1, 60),
        rows=tuple(
            Row(
                f"least_{least}",
                f"accepted at odds of {least} and more",
                "{accepted} accepted, {false} false, {predicted} predicted, {recall} of the right ones",
                partial(_at, least=least),
            )
            for least in (1, 10, 75)
        ),
        about="Simulated recordings that the weights were not fitted to.",
    ),
)
