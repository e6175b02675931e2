# SPDX-License-Identifier: Apache-2.0
"""What a run's part of the page says."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from objreg_ros.registration.gate.likelihood import log_odds
from objreg_tools.report.page import page
from objreg_tools.report.run.run_summary import RunSummary
from objreg_tools.report.run.sections import view_of_run
from objreg_tools.truth import Truth
from report.run.test_thumbnails import Wall
from report.runs import TRUE, TRUTH, closure, summary, tracked
from report.test_packed import unzipped

FINDING = {"what": "No image was read.", "cause": "All <malformed>.", "todo": "objreg inspect x", "anchor": "no-images"}


def view(of_run: dict[str, Any], truth: Truth = TRUTH) -> dict[str, Any]:
    return view_of_run(RunSummary.of("walk", of_run, truth), None)


def test_every_pair_has_a_row_with_its_numbers() -> None:
    of_run = summary(false=True)
    of_run["refusals"][1]["evidence"] = {"score": 0.31, "odds": -2.0}
    rows = {row["key"]: row for row in view(of_run)["pairs"]["rows"]}
    assert len(rows) == 8 and rows["c4"]["name"] == "false" and round(rows["c4"]["centimetres"]) == 50
    assert (rows["r1"]["name"], rows["r1"]["score"], rows["r1"]["odds"]) == ("texture disagrees", 0.31, -2.0)
    assert rows["r0"]["centimetres"] is None


def test_a_run_states_how_it_was_made() -> None:
    made = {"command": "objreg offline x", "version": "0.1.0", "commit": "abc-dirty", "date": "2026-01-01",
            "model": {"name": "cups.onnx", "sha256": "0123"}, "params": {"detector.threshold": 0.4}}  # fmt: skip
    rows = dict(view({**summary(), "about": made})["about"])
    assert rows["version"] == "0.1.0 abc-dirty" and rows["not the defaults"] == "detector.threshold = 0.4"
    assert rows["model"] == "cups.onnx (sha256 0123…)" and rows["command"] == "objreg offline x"
    assert view(summary())["about"] == []


def test_findings_are_shown_in_the_head_and_escaped() -> None:
    text = page([(RunSummary.of("walk", {**summary(), "findings": [FINDING]}, TRUTH), None)])
    head = text[: text.index('class="tiles"')]
    assert "No image was read." in head and "All &lt;malformed&gt;." in head
    assert "<code>objreg inspect x</code>" in head and "no-images" in head


def test_a_run_with_findings_does_not_say_that_no_candidate_was_certain_enough() -> None:
    of_run = {**summary(), "constraints": []}
    assert view(of_run)["said"].endswith("no candidate was certain enough.")
    assert view({**of_run, "findings": [FINDING]})["said"] == "No loop was closed."
    assert view({"frames": 0, "constraints": []})["said"] == "No loop was closed."


def test_one_revisit_is_counted_in_the_singular_and_once() -> None:
    stated = summary()
    one = view({**stated, "constraints": stated["constraints"][:1]})["said"]
    assert one.startswith("1 revisit, closed by 1 constraint, by ") and one.endswith("the only one is not false.")
    said = view(stated)["said"]
    assert said.startswith("1 revisit, closed by 4 constraints, by ") and said.endswith("none of the 4 is false.")


def test_the_tiles_count_revisits_and_constraints_apart() -> None:
    tiles = {tile["name"]: tile for tile in view(summary())["tiles"]}
    assert (tiles["revisits"]["value"], tiles["revisits"]["note"]) == ("1", "closed by 4 constraints")
    assert tiles["constraints"]["value"] == "4" and "better than odometry" in tiles["trajectory error"]["note"]
    still = {**summary(), "glimpses": [{**row, "T_odom_camera": np.eye(4).tolist(), "objects": []}
                                       for row in summary()["glimpses"]]}  # fmt: skip
    stayed = view(still, Truth([]))
    tiles = {tile["name"]: tile for tile in stayed["tiles"]}
    assert (tiles["revisits"]["value"], tiles["revisits"]["note"]) == ("0", "the camera never left")
    assert stayed["said"].startswith("The camera never left: 4 constraints between keyframes of one place, 0 revisits")


def test_a_trajectory_that_is_worse_for_its_constraints_is_called_worse() -> None:
    stated = summary()
    stated["glimpses"] = [{**row, "T_odom_camera": T.tolist()} for row, T in zip(stated["glimpses"], TRUE, strict=True)]
    stated["constraints"] = [
        {**closure(k, k + 60, off=0.12), "covariance": np.diag([1e-6] * 6).tolist()} for k in (5, 20)
    ]
    shown = view(stated)
    assert "% worse than odometry." in shown["trajectory"]["text"] and "drift out of" not in shown["trajectory"]["text"]
    (tile,) = (tile for tile in shown["tiles"] if tile["name"] == "trajectory error")
    assert "worse than odometry" in tile["note"] and tile["tone"] == "bad"


def test_the_pane_of_a_pair_has_its_evidence_with_bars_that_add_up() -> None:
    readings = {"correlation": 0.6, "matched": 2.0}
    stated = summary()
    stated["constraints"][0]["evidence"] = {**readings, "odds": 10.0 ** log_odds(readings)}
    pane = view(stated)["pairs"]["data"]["pairs"]["c0"]
    assert pane["total"] == pytest.approx(log_odds(readings), abs=1e-3)
    assert sum(weight for *_, weight in pane["evidence"] if weight is not None) == pytest.approx(
        pane["total"], abs=0.01
    )
    assert pane["least"] == pytest.approx(1.875, abs=1e-3)
    stated["about"] = {"params": {"registrar.least_odds": 100.0}}
    assert view(stated)["pairs"]["data"]["pairs"]["c0"]["least"] == 2.0


def test_the_pictures_of_a_pair_show_what_closed_it() -> None:
    stated = summary()
    for row in stated["glimpses"]:
        row["objects"] = [["cup", [0.1, 0.0, 2.0]]]
        row["outlines"] = ["400,300 500,300 500,400"]
    run = RunSummary.of("walk", {**stated, "constraints": [{**closure(5, 65), "labels": ["cup"]}]}, TRUTH)
    shown = view_of_run(run, Wall())
    marks = json.loads(unzipped(shown["pairs"]["data"]["marks"]))["c0"][0]
    assert marks.count(">cup</text>") == 2 and marks.count('<polygon class="mark m0"') == 2
    assert shown["galleries"][0]["cards"][0]["drawn"].marks == marks
    assert page([(run, Wall())]).count('class="both"') == 1 + sum(len(g["cards"]) for g in shown["galleries"])


def test_without_odometry_the_truth_is_drawn() -> None:
    of_run = summary()
    of_run["glimpses"] = [{**row, "T_odom_camera": None} for row in of_run["glimpses"]]
    way = view(of_run)["trajectory"]
    assert "is the ground truth" in way["text"] and [mark for mark, _ in way["legend"]] == [
        "true",
        "accepted",
    ]
    assert 'data-pair="c0"' in way["drawing"]["wide"]
    assert "neither odometry nor ground truth" in view(of_run, Truth([]))["trajectory"]["text"]


def test_without_odometry_and_truth_our_own_tracking_is_drawn_in_its_longest_stretch() -> None:
    of_run = summary()
    rows, lost = of_run["glimpses"], len(of_run["glimpses"]) // 4
    of_run["glimpses"] = [
        {**row, "T_odom_camera": None, "tracked": {"session": int(k >= lost), "T_session_camera": row["T_odom_camera"]}}
        for k, row in enumerate(rows)
    ]
    way = view(of_run, Truth([]))["trajectory"]
    assert f"{len(rows) - lost} of {len(rows)} frames" in way["text"]
    assert way["legend"][0] == ("tracked", "our own tracking") and "line tracked" in way["drawing"]["wide"]
    assert way["scene"]["trajectories"][0]["name"] == "our own tracking"


def test_our_own_tracking_is_drawn_corrected_with_what_of_it_is_left_out() -> None:
    lost = tracked(begins=45)
    lost["constraints"] = []
    for of_run, text in (
        (tracked(), "120 of 120 frames"),
        (lost, "45 frames in 1 more session are not: nothing ties"),
    ):
        way = view(of_run)["trajectory"]
        assert text in way["text"] and "There is no odometry" in way["text"]
        assert ("tracked", "our own tracking") in way["legend"] and ("corrected", "corrected") in way["legend"]
        assert 'class="line tracked"' in way["drawing"]["wide"]
    assert "than our own tracking" in next(tile for tile in view(tracked())["tiles"] if "error" in tile["name"])["note"]
    assert page([(RunSummary.of("walk", tracked(), TRUTH), None)])
