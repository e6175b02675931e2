# SPDX-License-Identifier: Apache-2.0
"""Topics about the running graph: its start, its load, and what is done to it. They need ROS 2."""

from __future__ import annotations

from functools import partial
from typing import Any

from figure_topics.topic import Row, Topic, Values


def _one(raw: Any) -> dict[str, Any]:
    found: dict[str, Any] = raw["objects"]["4"]["one"][0]
    return found


def _usage(raw: Any) -> Values:
    usage = _one(raw)["usage"].values()
    return {
        "percent": round(sum(row["cpu_percent"] for row in usage)),
        "gb": round(sum(row["memory_mb"] for row in usage) / 1000, 2),
    }


def _delay(raw: Any, key: str) -> Values:
    row = _one(raw)[key]
    row = row.get("registrar") or row.get("at_once") or row
    return {rank: round(row[rank]) if rank in row else "no" for rank in ("p50", "p95")}


def _start(raw: Any) -> Values:
    row = raw["detector, segmenter and registrar in one"]
    return {"seconds": round(row["seconds"], 1), "mb": round(row["megabytes"])}


def _library(raw: Any) -> Values:
    row = raw["first register() of the library"]
    return {"seconds": round(row["seconds"], 1), "mb": round(row["megabytes"])}


def _overload(raw: Any) -> Values:
    memory = raw["memory_mb"]["registrar"]
    third = memory[len(memory) // 3][1]
    return {
        "unaccounted": sum(raw["unaccounted"].values()),
        "end_s": "no end" if raw["seconds_from_sigint"] is None else f"{raw['seconds_from_sigint']:.1f} s",
        "third": round(third),
        "last": round(memory[-1][1]),
    }


def _attacks(raw: Any) -> Values:
    kinds = ("bug", "death", "hang", "greed", "wrong", "outside")
    tries = sum(row["tries"] for row in raw["targets"].values())
    return {"tries": tries, "targets": len(raw["targets"]), **{kind: raw.get(kind, 0) for kind in kinds}}


TOPICS = (
    Topic(
        name="start",
        title="Starting",
        script="benchmarks/start.py",
        quick="--rounds 3",
        whole="--rounds 5",
        minutes=(0.3, 1),
        rows=(
            Row("one", "all three nodes in one process until they listen", "{seconds} s, {mb} MB", _start, timed=True),
            Row("library", "the library with its first `register()`", "{seconds} s, {mb} MB", _library, timed=True),
        ),
        alone=True,
    ),
    Topic(
        name="latency",
        title="Live at 30 Hz, four objects",
        script="benchmarks/latency.py --objects 4 --composed 1 --seed 0",
        quick="--seconds 30",
        whole="--seconds 40",
        minutes=(1.4, 3),
        rows=(
            Row(
                "usage",
                "all nodes in one process, live at 30 Hz, four objects",
                "{percent} % of a core, {gb} GB",
                _usage,
                timed=True,
            ),
            Row(
                "frame",
                "from an image until the registrar has followed it",
                "{p50} ms (p95 {p95})",
                partial(_delay, key="end_to_end_ms"),
                timed=True,
            ),
            Row(
                "search",
                "a keyframe's search",
                "{p50} ms (p95 {p95})",
                partial(_delay, key="search_ms"),
                timed=True,
            ),
            Row(
                "constraint",
                "from an image to the constraints about it, once the camera is proven",
                "{p50} ms (p95 {p95})",
                partial(_delay, key="constraint_ms"),
                timed=True,
            ),
        ),
        alone=True,
    ),
    Topic(
        name="overload",
        title="One core, four times the camera's speed",
        script="benchmarks/overload.py --speed 4 --cores 1 --seed 0",
        quick="--seconds 35 --frames 150",
        whole="--seconds 300",
        minutes=(1.3, 6),
        rows=(
            Row("frames", "frames that no count accounts for", "{unaccounted}", _overload),
            Row("end", "from SIGINT to the end", "{end_s}", _overload, timed=True),
            Row(
                "memory",
                "memory of the registrar after a third of the run and at its end",
                "{third}, {last} MB",
                _overload,
            ),
        ),
        alone=True,
    ),
    Topic(
        name="attacks",
        title="Attacked",
        script="benchmarks/attacks.py --first 0",
        quick="--seconds 40 --workers 1",
        whole="--seconds 400",
        minutes=(1.9, 8),
        rows=(
            Row(
                "found",
                "spoilt messages, files and calls that led to a bug, death, hang, greed or wrong answer",
                "{bug}, {death}, {hang}, {greed}, {wrong} of {tries} against {targets} targets",
                _attacks,
            ),
        ),
        judges=True,
    ),
)
