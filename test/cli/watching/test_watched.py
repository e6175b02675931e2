# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json

import cv2
import numpy as np

from objreg_ros.bridge.node.accounting import Balance
from objreg_ros.data.images import Detections
from objreg_tools.cli.watching import watched as module
from objreg_tools.cli.watching.reports import NodeReport
from objreg_tools.cli.watching.watched import MOST_EDGES, MOST_NODES, MOST_OBJECTS, RECENT, Sight, Watched

COUNTERS = Balance(9, 6, 1, {"overtaken": 2}, {}, {"total": (3.0, 5.0), "search": (7.0, 8.0), "keyframe": (9.0, 9.5)})


def picture(stamp_ns: int) -> Sight:
    found = Detections(
        xyxy=np.array([[2, 3, 30, 20]], np.float32), score=np.array([0.5], np.float32), label=("cup",),
        image_hw=(24, 32), stamp_ns=stamp_ns,
    )  # fmt: skip
    return Sight(np.full((24, 32, 3), stamp_ns, np.uint8), found)


def test_what_nodes_report_is_shown_with_stages_beside_their_totals() -> None:
    watched = Watched()
    watched.report(
        "/registrar", NodeReport(COUNTERS, True, "nothing on odom", {"no_candidate": 3}, {"constraints": "5"})
    )
    watched.report("/detector", NodeReport(COUNTERS, False, "30 frames/s"))
    state = json.loads(json.dumps(watched.as_json()))
    assert [node["name"] for node in state["nodes"]] == ["/detector", "/registrar"]
    assert state["nodes"][1]["stages"] == [["total", 3.0, 5.0], ["search, keyframe", 7.0, 8.0],
                                           ["total, keyframe", 9.0, 9.5]]  # fmt: skip
    assert state["nodes"][1]["warns"] and not state["nodes"][0]["warns"]
    assert state["counts"] == {"constraints": "5"} and state["rejected"] == {"no_candidate": 3}


def test_the_newest_outcomes_come_first_and_stamps_keep_all_their_digits() -> None:
    watched = Watched()
    for k in range(3):
        watched.accept((2**61 + k, k), ("cup", "cup", "tv"), {"odds": 7.0})
        watched.refuse((k, 2**61 + k), "low_overlap", "0.1 of 0.2")
    state = watched.as_json()
    assert state["began"] == "0" and Watched().as_json()["began"] is None
    assert state["closures"][0] == {
        "from_ns": str(2**61 + 2),
        "to_ns": "2",
        "labels": "cup, tv",
        "score": None,
        "odds": 7.0,
    }
    assert [row["to_ns"] for row in state["refusals"]] == [str(2**61 + k) for k in (2, 1, 0)]


def test_whatever_is_published_for_however_long_takes_bounded_memory() -> None:
    watched = Watched()
    many = [(0.1 * k, 0.0, 0.0) for k in range(5000)]
    for k in range(200):
        watched.report(f"/node{k}", NodeReport(COUNTERS, False, "x" * 10_000))
        watched.accept((k, k), ["cup" * 1000], {})
        watched.refuse((k, k), "slack", "y" * 10_000)
    for point in many:
        watched.move(point)
    watched.move((float("nan"), 0.0, 0.0))
    watched.correct(many)
    watched.place({"accepted": many}, [("cup", point) for point in many])
    state = watched.as_json()
    assert len(state["nodes"]) == MOST_NODES and len(state["closures"]) == len(state["refusals"]) == RECENT
    assert max(len(state["odometry"]), len(state["corrected"])) <= module.MOST_POINTS
    assert len(state["edges"]["accepted"]) == 2 * MOST_EDGES and len(state["objects"]) == MOST_OBJECTS
    assert len(json.dumps(state, allow_nan=False)) < 1_000_000


def test_a_picture_is_drawn_once_and_the_next_takes_its_place() -> None:
    watched = Watched()
    assert watched.picture() is None and watched.as_json()["picture"] is None
    watched.see(picture(5))
    first = watched.picture()
    assert first is watched.picture() and watched.as_json()["picture"] == "5"
    watched.see(picture(200))
    second = watched.picture()
    assert first is not None and second is not None and first != second
    assert cv2.imdecode(np.frombuffer(second, np.uint8), cv2.IMREAD_COLOR).shape == (24, 32, 3)
