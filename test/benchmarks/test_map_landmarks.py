# SPDX-License-Identifier: Apache-2.0
"""Tests of objects as landmarks in a pose graph."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from registration.samples import SECOND, box, frame, keyframe

from objreg_mapper.params import MapperParams
from objreg_mapper.pose_graph import PoseGraph
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import Odometry
from objreg_ros.geometry import inverse, pose, rotation_from_vector, transform
from objreg_ros.memory.sighting import sightings_of
from objreg_tools.truth import Truth

XS = [*range(6), *range(4, -1, -1)]  # m along x, a second each: there and back
STAMPS = [k * SECOND for k in range(len(XS))]
TRUE = [pose(np.eye(3), np.array([float(x), 0.0, 0.0])) for x in XS]
OBJECTS = {"cup": np.array([0.0, 0.2, 1.0]), "book": np.array([2.0, -0.2, 1.2]), "mouse": np.array([4.0, 0.1, 0.9])}
REACH_M = 1.5


@pytest.fixture(autouse=True)
def _gtsam() -> None:
    pytest.importorskip("gtsam", reason="the map is solved with gtsam")


def shown(moved: Any = lambda label, k: np.zeros(3)) -> list[Any]:
    """What the cameras of a walk see, its objects ``moved`` by the k-th of them."""
    from map_landmarks import Shown

    found = []
    for k, T in enumerate(TRUE):
        near = {label: xyz for label, xyz in OBJECTS.items() if np.linalg.norm(xyz - T[:3, 3]) < REACH_M}
        near = {label: transform(inverse(T), xyz + moved(label, k)) for label, xyz in near.items()}
        sightings = sightings_of(keyframe(k, k, tuple(box(label, tuple(xyz)) for label, xyz in near.items())))
        found.append(Shown(STAMPS[k], np.array([*near.values()]).reshape(-1, 3), sightings))
    return found


def drifted() -> list[Array]:
    """Odometry that turns by a degree with every metre."""
    step = [inverse(a) @ b for a, b in pairwise(TRUE)]
    turn, poses = pose(rotation_from_vector(np.radians([0.0, 1.0, 0.0])), np.zeros(3)), [TRUE[0]]
    for T in step:
        poses.append(poses[-1] @ turn @ T)
    return poses


def graph_of(poses: list[Array]) -> PoseGraph:
    graph = PoseGraph()
    for stamp, T in zip(STAMPS, poses, strict=True):
        graph.add_odometry(Odometry(T_odom_body=T, stamp_ns=stamp))
    return graph


def error_m(poses: Any) -> float:
    return max(float(np.linalg.norm(T[:3, 3] - there[:3, 3])) for T, there in zip(poses, TRUE, strict=True))


def test_what_is_at_one_place_is_one_landmark() -> None:
    from map_landmarks import named

    seen = shown()
    names = named(seen, Truth(zip(STAMPS, TRUE, strict=True)).at)
    rows = zip(seen, names, strict=True)
    labels = {pair for one, row in rows for pair in zip(row, (s.label for s in one.sightings), strict=True)}
    assert len(labels) == len(OBJECTS) < sum(map(len, names))


def test_without_places_closures_alone_say_what_is_one_landmark() -> None:
    from map_landmarks import named

    assert len(shown()[0].sightings) == len(shown()[-1].sightings) == 1
    closure = LoopClosure(
        from_ns=STAMPS[0], to_ns=STAMPS[-1], T_from_to=np.eye(4), covariance=0.01 * np.eye(6), labels=("cup",)
    )
    alone, closed = named(shown(), None), named(shown(), None, [closure])
    assert len({number for row in alone for number in row}) == sum(len(row) for row in alone)
    assert closed[0] == closed[-1] and len({n for row in closed for n in row}) == sum(len(row) for row in alone) - 1
    elsewhere = replace(closure, T_from_to=pose(np.eye(3), np.array([0.5, 0.0, 0.0])))
    assert named(shown(), None, [elsewhere]) == alone


def test_landmarks_take_the_drift_away_and_one_that_moved_is_left_out() -> None:
    from map_landmarks import marks_of, named, solved
    from map_peers import Dense

    graph, truth = graph_of(drifted()), Truth(zip(STAMPS, TRUE, strict=True))
    names = named(shown(), truth.at)
    sigmas = MapperParams().picture_sigmas
    poses, out = solved(Dense.of(graph), marks_of(graph, shown(), names), sigmas)
    assert error_m(drifted()) > 0.2 and out == 0 and error_m(poses) < 0.5 * error_m(drifted())
    gone = shown(lambda label, k: np.array([0.0, 0.0, -0.4 * (label == "book" and k > 6)]))
    again, out = solved(Dense.of(graph), marks_of(graph, gone, names), sigmas)
    assert out >= 1 and error_m(again) < 0.7 * error_m(drifted())


def test_sightings_are_moved_to_the_graphs_keyframes_and_those_that_tie_nothing_are_left_out() -> None:
    from map_landmarks import marks_of

    graph, seen = graph_of(TRUE), shown()
    late = [replace(one, stamp_ns=one.stamp_ns + SECOND // 10) for one in seen[:-1]]
    marks = marks_of(graph, late, [tuple(1 for _ in one.sightings) for one in late])
    first = late[0].xyz[0] + np.array([0.1, 0.0, 0.0])  # the camera went on by 10 cm
    assert marks.nodes[0] == 0 and np.allclose(marks.xyz[0], first, atol=1e-3)
    assert (marks.sigmas[:, 1] > marks.sigmas[:, 0]).all()
    number = iter(range(100))
    assert not len(marks_of(graph, seen, [tuple(next(number) for _ in one.sightings) for one in seen]).nodes)


def test_how_far_sightings_wander_is_measured_and_exact_ones_do_not() -> None:
    from map_landmarks import exact, named, wandering

    truth = Truth(zip(STAMPS, TRUE, strict=True))
    nearer = [replace(one, xyz=one.xyz * (0.97 if k % 2 else 1.0)) for k, one in enumerate(shown())]
    names = named(nearer, truth.at)
    figures = wandering(nearer, names, truth)
    assert figures["landmarks"] == len(OBJECTS) and figures["shares"][1] > figures["shares"][0]
    none = wandering(exact(nearer, names, truth), names, truth)
    assert none["along_cm"] == pytest.approx(0.0, abs=1e-6)


def test_keyframes_of_frames_have_their_objects_middles_in_the_camera() -> None:
    from map_landmarks import shown_of

    cups = (box("cup", (0.0, 0.0, 1.0)),)
    found = shown_of(frame(0.1 * k, cups, pose(np.eye(3), np.array([0.05 * k, 0.0, 0.0]))) for k in range(10))
    assert len(found) > 1 and all(np.allclose(one.xyz, found[0].xyz, atol=0.15) for one in found)
    assert found[0].sightings[0].label == "cup"


def test_a_recording_is_compared_with_and_without_landmarks_for_each_drift() -> None:
    from map_landmarks import BASE, compare
    from map_limits import ODOMETRY, Case

    frames = [frame(1e-9 * stamp, (), T) for stamp, T in zip(STAMPS, TRUE, strict=True)]
    closure = LoopClosure(from_ns=0, to_ns=STAMPS[-1], T_from_to=np.eye(4), covariance=1e-6 * np.eye(6), labels=())
    figures = compare(Case("walk", frames, Truth(zip(STAMPS, TRUE, strict=True)), [closure]), shown(), 2)
    means = {name: np.mean(cm) for name, cm in figures["cm"].items()}
    assert {len(cm) for cm in figures["cm"].values()} == {2} and figures["landmarks"] == len(OBJECTS)
    assert means["by true places, seen exactly"] < means[BASE] < means[ODOMETRY]


def test_the_table_gives_the_means_and_in_how_many_drifts_landmarks_help() -> None:
    from map_landmarks import BASE, table

    figures = {
        "closures": 2, "sightings": 9, "landmarks": 3, "extent_cm": 20.0, "across_cm": 1.0, "along_cm": 2.0,
        "shares": [0.05, 0.1], "cm": {BASE: [1.0, 2.0], "landmarks": [0.5, 2.5]}, "left_out": {"landmarks": [1, 2]},
    }  # fmt: skip
    row = table("walk", figures).splitlines()[-1].split()
    assert row == ["landmarks", "1.50", "0.50", "2.50", "1.00", "1/2", "1.5"]
