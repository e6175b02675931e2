# SPDX-License-Identifier: Apache-2.0
"""What is written of a corrected map."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from registration.samples import SECOND, box, cloud, keyframe, moved

from objreg_ros.geometry import transform
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store import Store
from objreg_ros.registration.keyframe import Keyframe
from objreg_tools.report.exports.map_files import MapFiles
from objreg_tools.report.run.run_summary import RunSummary
from objreg_tools.truth import Truth
from report.ply_reader import positions, read_ply
from report.runs import COUNT, TRUE, TRUTH, summary

NOWHERE = Path("no_store")


@pytest.fixture(scope="module")
def walk() -> RunSummary:
    return RunSummary.of("walk", summary(false=True), TRUTH)


def rows_of(file: Path) -> np.ndarray:
    return np.array([line.split() for line in file.read_text().splitlines()], float)


def straight(seconds: int) -> RunSummary:
    """A camera that goes a metre a second along x, without closures."""
    glimpses = [{"stamp_ns": k * SECOND, "T_odom_camera": moved(k).tolist()} for k in range(seconds)]
    return RunSummary.of("straight", {"glimpses": glimpses, "constraints": []}, Truth([]))


def store_of(path: Path, *keyframes: Keyframe) -> Path:
    store = Store(path)
    for taken in keyframes:
        store.write_keyframe(taken, sightings_of(taken), [])
    store.close()
    return path


def taken(number: int, seconds: float, *objects: object, x: float | None = None) -> Keyframe:
    made = keyframe(number, seconds, objects, T_odom_camera=moved(seconds if x is None else x))  # type: ignore[arg-type]
    return replace(made, by_odometry=True)


def test_the_trajectories_are_the_corrected_way_at_every_frame(walk: RunSummary, tmp_path: Path) -> None:
    notices: list[str] = []
    MapFiles(tum=tmp_path / "way.tum", kitti=tmp_path / "way.kitti").write(walk, NOWHERE, notices.append)
    tum, kitti = rows_of(tmp_path / "way.tum"), rows_of(tmp_path / "way.kitti").reshape(-1, 3, 4)
    assert tum[:, 0].tolist() == [k / 10 for k in range(COUNT)]
    np.testing.assert_allclose(kitti[:, :, 3], tum[:, 1:4], atol=1e-8)
    _, odometry, corrected = walk.poses_before_and_after()
    np.testing.assert_allclose(kitti, [T[:3] for T in corrected], atol=1e-8)
    end = TRUE[0] @ np.vstack([kitti[-1], [0, 0, 0, 1]])  # odometry began at the identity
    drifted = np.linalg.norm((TRUE[0] @ odometry[-1])[:3, 3] - TRUE[-1][:3, 3])
    assert np.linalg.norm(end[:3, 3] - TRUE[-1][:3, 3]) < 0.5 * drifted
    assert notices == [f"{tmp_path / name}: {COUNT} poses" for name in ("way.tum", "way.kitti")]


def test_the_trajectory_before_it_was_corrected_and_the_true_one_have_the_same_stamps(
    walk: RunSummary, tmp_path: Path
) -> None:
    files = {"tum": tmp_path / "after", "tum_before": tmp_path / "before", "tum_truth": tmp_path / "true"}
    MapFiles(**files).write(walk, NOWHERE)
    after, before, true = map(rows_of, files.values())
    np.testing.assert_array_equal(before[:, 0], after[:, 0])
    np.testing.assert_array_equal(true[:, 0], after[:, 0])
    _, odometry, _ = walk.poses_before_and_after()
    np.testing.assert_allclose(before[:, 1:4], [T[:3, 3] for T in odometry], atol=1e-8)
    np.testing.assert_allclose(true[:, 1:4], [T[:3, 3] for T in TRUE], atol=1e-8)


def test_of_our_own_tracking_the_trajectory_before_is_written_too(tmp_path: Path) -> None:
    rows = [
        {"stamp_ns": k * SECOND, "tracked": {"session": 4, "T_session_camera": moved(k).tolist()}} for k in range(3)
    ]
    run = RunSummary.of("straight", {"glimpses": rows, "constraints": [], "odometry": "tracked"}, Truth([]))
    MapFiles(tum_before=tmp_path / "before").write(run, NOWHERE)
    assert rows_of(tmp_path / "before")[:, :4].tolist() == [[k, k, 0, 0] for k in range(3)]


def test_the_graph_has_the_keyframes_and_what_ties_them_but_what_was_pruned(walk: RunSummary, tmp_path: Path) -> None:
    MapFiles(g2o=tmp_path / "graph.g2o").write(walk, NOWHERE)
    lines = [line.split() for line in (tmp_path / "graph.g2o").read_text().splitlines()]
    vertices = [line for line in lines if line[0] == "VERTEX_SE3:QUAT"]
    edges = [(int(line[1]), int(line[2])) for line in lines if line[0] == "EDGE_SE3:QUAT"]
    count = len(walk.graph.keyframes)
    assert len(walk.pruned) == 1
    assert len(vertices) == count and len(edges) == count - 1 + 4
    times = [line.split(",") for line in (tmp_path / "graph.g2o.times.csv").read_text().splitlines()[1:]]
    assert [int(row[0]) for row in times] == list(range(count))
    assert [int(row[1]) for row in times] == [stamp for stamp, _ in walk.graph.path()]
    np.testing.assert_allclose(np.array(vertices[-1][2:5], float), walk.graph.path()[-1][1][:3, 3], atol=1e-8)


def test_the_cloud_is_what_the_keyframes_saw_at_their_corrected_places(tmp_path: Path) -> None:
    store = store_of(tmp_path / "place.db", taken(1, 0.0), taken(2, 3.0))
    notices: list[str] = []
    MapFiles(cloud=tmp_path / "map.ply", voxel=0.07).write(straight(5), store, notices.append)
    table, seen = read_ply(tmp_path / "map.ply"), keyframe().view
    expected = np.concatenate([transform(moved(x), seen.xyz.reshape(-1, 3)) for x in (0.0, 3.0)])
    assert abs(len(table) - len(np.unique(np.floor(expected / 0.07), axis=0))) <= 2  # at the edge of a voxel
    np.testing.assert_allclose(positions(table).min(axis=0), expected.min(axis=0), atol=0.07)
    np.testing.assert_allclose(positions(table).max(axis=0), expected.max(axis=0), atol=0.07)
    assert np.array_equal(table["red"], table["blue"]) and table["red"].std() > 10
    assert notices == [f"{tmp_path / 'map.ply'}: {len(table)} points, one for each voxel of 7 cm"]


def test_a_map_that_is_bent_bends_its_cloud(tmp_path: Path) -> None:
    """A closure says that the camera came back to where it was: what it saw from there lies where it lay before."""
    way = [*np.arange(0.0, 2.0, 0.05), *np.arange(2.0, 0.02, -0.05)]  # the way back is 5 cm short
    glimpses = [{"stamp_ns": k * SECOND, "T_odom_camera": moved(x).tolist()} for k, x in enumerate(way)]
    last = len(way) - 1
    closure = {
        "from_ns": 0,
        "to_ns": last * SECOND,
        "T_from_to": np.eye(4).tolist(),
        "covariance": np.diag([1e-6] * 6).tolist(),
        "labels": [],
    }
    run = RunSummary.of("back", {"glimpses": glimpses, "constraints": [closure]}, Truth([]))
    mark = cloud("cup", np.array([[0.0, 0.0, 1.0]]), rgb=np.uint8([[255, 0, 0]]))
    store = store_of(tmp_path / "place.db", taken(1, 0.0, mark), taken(2, last, mark, x=way[-1]))
    MapFiles(cloud=tmp_path / "map.ply").write(run, store)
    table = read_ply(tmp_path / "map.ply")
    red = positions(table)[(table["red"] > 200) & (table["green"] < 50)]
    assert way[-1] > 0.04 and np.ptp(red, axis=0).max() < 0.025


def test_objects_keep_their_colours_in_a_grey_room(tmp_path: Path) -> None:
    red = np.tile(np.uint8([200, 10, 10]), (400, 1))
    cup = replace(box("cup", (0.0, 0.0, 1.0)), rgb=red)
    store = store_of(tmp_path / "place.db", taken(1, 0.0, cup))
    MapFiles(cloud=tmp_path / "map.ply").write(straight(2), store)
    table = read_ply(tmp_path / "map.ply")
    near = np.abs(positions(table) - [0.0, 0.0, 1.0]).max(axis=1) < 0.05
    assert near.sum() > 50 and (table["red"][near] == 200).all() and (table["green"][near] == 10).all()


def test_keyframes_of_another_run_in_the_same_store_are_left_out(tmp_path: Path) -> None:
    others = taken(2, 1.0, x=1.01), taken(3, 1.5), replace(taken(4, 1.0), by_odometry=False)
    notices: list[str] = []
    MapFiles(cloud=tmp_path / "map.ply").write(straight(3), store_of(tmp_path / "a.db", taken(1, 1.0)), notices.append)
    MapFiles(cloud=tmp_path / "both.ply").write(
        straight(3), store_of(tmp_path / "b.db", taken(1, 1.0), *others), notices.append
    )
    assert (tmp_path / "map.ply").read_bytes() == (tmp_path / "both.ply").read_bytes()
    assert (
        notices[1] == "3 keyframes of the store are not on the map: they are of another run, or not of the trajectory"
    )


def test_keyframes_of_our_own_tracking_are_on_its_map_and_those_of_odometry_are_not(tmp_path: Path) -> None:
    rows = [
        {"stamp_ns": k * SECOND, "tracked": {"session": 4, "T_session_camera": moved(k).tolist()}} for k in range(3)
    ]
    run = RunSummary.of("straight", {"glimpses": rows, "constraints": [], "odometry": "tracked"}, Truth([]))
    store = store_of(tmp_path / "a.db", replace(taken(1, 1.0), by_odometry=False), taken(2, 2.0))
    notices: list[str] = []
    MapFiles(tum=tmp_path / "way.tum", cloud=tmp_path / "map.ply").write(run, store, notices.append)
    assert (
        notices[1] == "1 keyframes of the store are not on the map: they are of another run, or not of the trajectory"
    )
    assert len(read_ply(tmp_path / "map.ply")) > 1000 and len(rows_of(tmp_path / "way.tum")) == 3


def test_a_damaged_keyframe_is_left_out_and_reported(tmp_path: Path) -> None:
    store = store_of(tmp_path / "place.db", taken(1, 0.0), taken(2, 1.0))
    with closing(sqlite3.connect(store)) as connection, connection:
        connection.execute("UPDATE scene SET view = x'00' WHERE id = 2")
    notices: list[str] = []
    MapFiles(cloud=tmp_path / "map.ply").write(straight(2), store, notices.append)
    assert notices[0].startswith("keyframe 2 is left out: ") and len(read_ply(tmp_path / "map.ply")) > 1000


def test_a_run_without_odometry_has_no_map(tmp_path: Path) -> None:
    run = {"glimpses": [{"stamp_ns": 0}, {"stamp_ns": 1}], "constraints": []}
    with pytest.raises(ValueError, match="--tum: expected frames with odometry, got none of 2: there is no map"):
        MapFiles(tum=tmp_path / "way.tum").write(RunSummary.of("blind", run, Truth([])), NOWHERE)
    assert not (tmp_path / "way.tum").exists()
