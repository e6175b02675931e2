# SPDX-License-Identifier: Apache-2.0
"""The run in space: what is up, what ties what, and which objects are where."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.geometry import pose, rotation_from_vector
from objreg_tools.report.run.run_summary import RunSummary
from objreg_tools.report.run.scene import levelling, scene
from report.runs import OBJECTS, TRUTH, summary
from report.test_packed import unpacked

UPRIGHT = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # of a camera that looks along y while z is up


def drawn(run: RunSummary) -> dict:
    tracks = run.tracks()
    return scene(run, tracks.stamps_ns, tracks.lines, tracks)


def test_the_ways_are_there_by_name() -> None:
    run = RunSummary.of("walk", summary(), TRUTH)
    ways = {way["name"]: unpacked(way) for way in drawn(run)["trajectories"]}
    assert {*ways} == {"truth", "odometry", "corrected"}
    assert np.allclose(ways["truth"], run.tracks().true, atol=1e-3)


def test_closures_are_distinguished_by_verdict_and_by_what_the_mapper_pruned() -> None:
    run = RunSummary.of("walk", summary(false=True), TRUTH)
    run = replace(run, pruned=(run.closures[1], run.closures[4]))
    groups = {group["name"]: group for group in drawn(run)["closures"]}
    assert {name: group["keys"] for name, group in groups.items()} == {
        "closure": ["c0", "c2", "c3"], "pruned closure": ["c1"], "pruned false closure": ["c4"]
    }  # fmt: skip
    ends = unpacked(groups["pruned false closure"])
    assert np.allclose(ends, run.tracks().corrected[[10, 90]], atol=1e-3)


def test_objects_are_where_truth_has_them_and_named_once() -> None:
    made = drawn(RunSummary.of("walk", summary(), TRUTH))
    assert [heap["name"] for heap in made["objects"]] == ["cup", "book"]
    names = dict(zip(made["names"]["text"], unpacked(made["names"]), strict=True))
    assert made["names"]["text"].count("cup") == 2 and np.allclose(names["book"], OBJECTS[2][1], atol=0.1)


def test_a_run_without_odometry_has_the_true_way_with_its_closures() -> None:
    run = RunSummary.of("blind", {**summary(), "glimpses": []}, TRUTH)
    stamps_ns, true = run.true_trajectory()
    made = scene(run, stamps_ns, {"true": true}, None)
    assert [way["name"] for way in made["trajectories"]] == ["truth"] and made["objects"] == []
    assert len(made["closures"][0]["keys"]) == 4


@pytest.mark.parametrize("up", [(0, 0, 1), (0, -1, 0), (1, 0, 0)])
def test_an_axis_that_is_up_for_the_cameras_becomes_z(up: tuple[int, int, int]) -> None:
    turn = rotation_from_vector(np.pi / 2 * np.cross((0, 0, 1), up))
    nodding = [turn @ UPRIGHT @ rotation_from_vector(np.array([tilt, 0, 0])) for tilt in (0.1, 0.4)]
    T_level = levelling(pose(np.array(nodding), np.zeros(3)))
    assert np.allclose(T_level[:3, :3] @ up, [0, 0, 1]) and np.isclose(np.linalg.det(T_level), 1.0)


def test_a_frame_with_no_axis_that_is_up_is_levelled_by_the_mean_and_one_without_up_is_left() -> None:
    tilted = pose(rotation_from_vector(np.array([0.8, 0, 0])) @ UPRIGHT, np.zeros(3))
    assert np.allclose(levelling(tilted[None])[:3, :3] @ -tilted[:3, 1], [0, 0, 1])
    rolled = [pose(rotation_from_vector(np.array([0, 0, a])), np.zeros(3)) for a in (0, np.pi)]
    assert np.array_equal(levelling(np.array(rolled)), np.eye(4))
