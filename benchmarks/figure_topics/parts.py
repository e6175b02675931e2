# SPDX-License-Identifier: Apache-2.0
"""Topics about single parts: detector, segmenter, mapper, store, and work over processes."""

from __future__ import annotations

from typing import Any

from figure_topics.topic import Row, Topic, Values

OURS, PEERS = "objreg", ("GTSAM LM", "GTSAM GNC")  # as map_peers names them


def _robust(raw: Any) -> Values:
    ours, rows = raw["summary"][OURS], raw["graphs"]
    return {
        "above": round(ours["above_1.3"] * len(rows)),
        "graphs": len(rows),
        "kept": ours["false_kept"],
        "false": sum(row["false"] for row in rows),
        "pruned": ours["right_pruned"],
        "right": sum(row["closures"] - row["false"] for row in rows),
    }


def _robust_peer(raw: Any) -> Values:
    rows = {name: row for name, row in raw["summary"].items() if name in PEERS}
    one = "{}: {} false ones kept"
    return {"peers": "; ".join(one.format(name, row["false_kept"]) for name, row in rows.items())}


def _scale(raw: Any) -> Values:
    last = raw["parts"][-1]
    return {
        "keyframes": last["keyframes"],
        "closures": last["closures"],
        "ms": round(last["processor_ms"][0]),
        "p95": round(last["processor_ms"][1]),
        "mb": round(last["memory_mb"]),
        "cm": round(100 * last["ate_m"]),
    }


def _store(raw: Any) -> Values:
    size = max(raw["sizes"], key=int)
    row = raw["sizes"][size]
    return {
        "objects": int(size),
        "p50": round(row["query_ms"]["p50"], 2),
        "keyframe": round(row["keyframe_query_ms"]["p50"], 1),
        "ratio": round(raw["frame_ratio"], 2),
    }


def _compact(raw: Any) -> Values:
    row = next(iter(raw.values()))
    return {
        "kb": round(row["bytes"]["median"] / 1000),
        "p95": round(row["bytes"]["p95"] / 1000),
        "before": round(row["as_it_was"]["accepted_recall"], 2),
        "after": round(row["as_it_came"]["accepted_recall"], 2),
        "wrong": row["as_it_came"]["wrong"],
    }


def _batch(raw: Any) -> Values:
    one, two = (raw["runs"][name]["seconds"] for name in ("1", "2"))
    same = sum(bool(row["same"]) for row in raw["runs"].values())
    return {"times": round(one / two, 2), "same": same, "runs": len(raw["runs"]), "recordings": raw["recordings"]}


def _sensor(raw: Any) -> Values:
    off = [row["off_deg"][0] for name, row in raw.items() if not name.startswith("realsense")]
    return {"off": round(max(off), 2), "streams": len(off)}


TOPICS = (
    Topic(
        name="detector",
        title="The detector that comes along",
        script="benchmarks/detector.py --seed 1",
        quick="--quick",
        whole="",
        minutes=(0.5, 2),
        rows=(
            Row(
                "map50",
                "map50 on pictures of unseen simulated rooms",
                "{map} on {pictures} pictures",
                lambda raw: {"map": round(raw["map50_sim"], 3), "pictures": raw["pictures"]},
            ),
            Row("time", "a picture, two threads", "{ms} ms", lambda raw: {"ms": round(raw["ms_p50"], 1)}, timed=True),
        ),
    ),
    Topic(
        name="segmentation",
        title="Segmentation",
        script="benchmarks/segmentation.py --seed 401",
        quick="--quick",
        whole="",
        minutes=(0.4, 2),
        rows=(
            Row(
                "iou",
                "IoU of the masks of simulated objects, median (p10)",
                "{median} ({p10}); the founding filter {paper}",
                lambda raw: {
                    "median": round(raw["iou_median_sim"], 2),
                    "p10": round(raw["iou_p10_sim"], 2),
                    "paper": round(raw["paper_iou_median_sim"], 2),
                },
            ),
            Row(
                "time",
                "a frame of four boxes, of the processor",
                "{ms} ms, {ratio} × faster than Open3D's planes",
                lambda raw: {"ms": round(raw["cpu_ms_p50"], 1), "ratio": round(raw["ratio_open3d"], 1)},
            ),
        ),
    ),
    Topic(
        name="mapper_robust",
        title="The mapper against false closures",
        script="benchmarks/mapper.py robust --seed 0",
        quick="--graphs 20 --peers 'GTSAM LM'",
        whole="--graphs 60 --peers 'GTSAM LM,GTSAM GNC'",
        minutes=(0.5, 2),
        rows=(
            Row("worse", "random maps that are worse by more than 1.3 times", "{above} of {graphs}", _robust),
            Row(
                "kept",
                "false closures that are believed; right ones that are not",
                "{kept} of {false}; {pruned} of {right}",
                _robust,
            ),
            Row("peers", "the same with GTSAM's optimisers", "{peers}", _robust_peer),
        ),
        about="A tenth to three tenths of each map's closures are false. Worse: than with the right ones alone.",
    ),
    Topic(
        name="mapper_scale",
        title="The mapper over kilometres",
        script="benchmarks/mapper.py scale --seed 1 --no-peers",
        quick="--poses 4000 --closures 200",
        whole="",
        minutes=(0.8, 50),
        rows=(
            Row(
                "closure",
                "one more closure, of the processor",
                "{ms} ms (p95 {p95}) with {keyframes} keyframes and {closures} closures",
                _scale,
            ),
            Row("memory", "memory; error of the trajectory", "{mb} MB; {cm} cm", _scale),
        ),
    ),
    Topic(
        name="sensor",
        title="Depth beside colour",
        script="benchmarks/sensor.py --seed 31",
        quick="--frames 20",
        whole="--frames 60",
        minutes=(0.4, 1),
        rows=(
            Row(
                "offset",
                "offset from depth to colour, off by, worst median of the rigs of Kinect and Azure",
                "{off}° of {streams} streams",
                _sensor,
            ),
        ),
    ),
    Topic(
        name="store",
        title="The store",
        script="benchmarks/store.py",
        quick="--quick",
        whole="",
        minutes=(1, 4),
        rows=(
            Row(
                "query",
                "one object looked up; those of a keyframe",
                "{p50} ms; {keyframe} ms, of {objects} objects",
                _store,
                timed=True,
            ),
            Row("frame", "a frame, over one with 100 objects in the store", "{ratio} ×", _store),
            Row(
                "kills",
                "acknowledged keyframes that are lost when the process is killed",
                "{lost} of {acknowledged}, {kills} kills",
                lambda raw: {
                    "lost": raw["kills"]["lost"],
                    "acknowledged": raw["kills"]["acknowledged_keyframes"],
                    "kills": raw["kills"]["kills"],
                },
            ),
        ),
    ),
    Topic(
        name="compact",
        title="Keyframes on the air",
        script="benchmarks/compact.py --model COCO --threshold 0.4 --seed 1",
        quick="RPY --wanted 20",
        whole="RPY --wanted 200",
        minutes=(0.6, 2),
        rows=(
            Row("size", "a packed keyframe, median (p95)", "{kb} kB ({p95})", _compact),
            Row(
                "accepted",
                "right and accepted before packing and after; wrong after",
                "{before}, {after}; {wrong}",
                _compact,
            ),
        ),
    ),
    Topic(
        name="batch",
        title="Many recordings over processes",
        script="benchmarks/batch.py --workers 1,2 --keep KEEP",
        quick="--simulate 3 --frames 30",
        whole="--simulate 8 --frames 60",
        minutes=(1.2, 20),
        rows=(
            Row("times", "two workers over one", "{times} × as fast, {recordings} recordings", _batch, timed=True),
            Row("same", "runs, one with a worker that is killed, of the same result", "{same} of {runs}", _batch),
        ),
        alone=True,
    ),
)
