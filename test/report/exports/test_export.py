# SPDX-License-Identifier: Apache-2.0
"""Exported files."""

from __future__ import annotations

import json
import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from registration.samples import box, keyframe, moved

from objreg_ros.data.closures import LoopClosure
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store import Store
from objreg_tools.report.exports.export import export
from objreg_tools.report.exports.occupancy_grid import GridParams
from report.ply_reader import positions, read_ply


def test_points_far_from_the_origin_of_the_odometry_keep_their_places(tmp_path: Path) -> None:
    item = box("cup", (0, 0, 1))
    T_utm_camera = moved(450_000.0)
    T_utm_camera[1, 3] = 5_400_000.0
    taken = keyframe(1, 2.0, (item,), T_odom_camera=T_utm_camera)
    store = Store(tmp_path / "place.db")
    store.write_keyframe(taken, sightings_of(taken), [])
    store.close()
    *files, map_file = export(tmp_path / "place.db", tmp_path / "out")
    kept = Store(tmp_path / "place.db", read_only=True).keyframe(1)
    for file, xyz in zip(files, (kept.objects[0].cloud.xyz, kept.context.xyz), strict=True):
        table = read_ply(file)
        offset_m = positions(table) - T_utm_camera[:3, 3]
        np.testing.assert_allclose(offset_m, xyz, atol=1e-6)
    (landmark,) = json.loads(map_file.read_text())["landmarks"]
    np.testing.assert_allclose(landmark["position"] - T_utm_camera[:3, 3], kept.objects[0].centroid, atol=1e-6)


def test_a_store_becomes_clouds_in_the_frame_of_the_session_and_a_map(tmp_path: Path) -> None:
    store = Store(tmp_path / "place.db")
    taken = keyframe(1, 2.0, (box("cell phone", (0, 0, 1)),), T_odom_camera=moved(5.0))
    taken = replace(taken, objects=(replace(taken.objects[0], sightings=3),))
    (sighting,) = sightings_of(taken)
    closure = LoopClosure(from_ns=1, to_ns=2, T_from_to=moved(0.3), covariance=np.eye(6), labels=("cup",))
    store.write_keyframe(taken, [sighting.of_landmark(7, np.eye(3))], [closure])
    store.close()
    files = list(export(tmp_path / "place.db", tmp_path / "out"))
    assert [str(f.relative_to(tmp_path / "out")) for f in files] == [
        "objects/00007_cell_phone/keyframe_000001_001.ply",
        "contexts/keyframe_000001.ply",
        "map.json",
    ]
    assert abs(float(read_ply(files[0])["x"].mean()) - 5.0) < 0.05
    content = json.loads(files[2].read_text())
    (item,) = content["keyframes"][0]["objects"]
    assert (item["landmark"], item["frames"], item["density"]) == (7, 3, taken.objects[0].cloud.density)
    assert [(known["landmark"], known["label"], known["sightings"]) for known in content["landmarks"]] == [
        (7, "cell phone", 1)
    ]
    assert np.allclose(content["landmarks"][0]["position"], [5.0, 0.0, 1.0], atol=0.05)
    (written,) = content["closures"]
    assert (
        written["to_ns"] == 2
        and written["from_frame_id"] == "camera"
        and written["from_robot"] == ""
        and written["objects"] == []
    )


def test_two_objects_of_a_keyframe_are_two_files_even_where_they_are_one_landmark(tmp_path: Path) -> None:
    store = Store(tmp_path / "place.db")
    taken = keyframe(1, 2.0, (box("cup", (0, 0, 1)), box("cup", (0.4, 0, 1), instance=2)))
    store.write_keyframe(taken, [sighting.of_landmark(7, np.eye(3)) for sighting in sightings_of(taken)])
    store.close()
    first, second, *_ = export(tmp_path / "place.db", tmp_path / "out")
    middles = [float(read_ply(file)["x"].mean()) for file in (first, second)]
    assert np.allclose(middles, (0.0, 0.4), atol=0.02)


def _store_of(path: Path, *labels: str) -> Path:
    """A store with a keyframe for each label."""
    store = Store(path)
    for number, label in enumerate(labels, start=1):
        taken = keyframe(number, 2.0 * number, (box(label, (0, 0, 1)),))
        store.write_keyframe(taken, [s.of_landmark(number, np.eye(3)) for s in sightings_of(taken)])
    store.close()
    return path


def _damage(path: Path, table: str, column: str, number: int) -> None:
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute(f"UPDATE {table} SET {column} = x'00' WHERE id = ?", (number,))


@pytest.mark.parametrize(("table", "column"), [("scene", "view"), ("cloud", "points"), ("object", "position")])
def test_a_damaged_keyframe_is_left_out_and_named(tmp_path: Path, table: str, column: str) -> None:
    _damage(_store_of(tmp_path / "place.db", "cup", "book", "can"), table, column, 2)
    notices: list[str] = []
    *clouds, content = export(tmp_path / "place.db", tmp_path / "out", notices.append)
    assert len(clouds) == 4 and not any("000002" in file.name for file in clouds)
    kept = json.loads(content.read_text())
    assert [row["id"] for row in kept["keyframes"]] == [1, 3] and kept["damaged"] == [2]
    assert [row["label"] for row in kept["landmarks"]] == ["cup", "can"]
    assert len(notices) == 1 and notices[0].startswith("keyframe 2 is left out: ")


@pytest.mark.parametrize("there", [False, True])
def test_an_export_that_fails_leaves_nothing_half_written(
    tmp_path: Path, there: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> Path:
        raise OSError("no space left")

    _store_of(tmp_path / "place.db", "cup", "book")
    if there:
        (tmp_path / "out").mkdir()
    with monkeypatch.context() as patched:
        patched.setattr("objreg_tools.report.exports.export._write_json", refuse)
        with pytest.raises(OSError, match="no space left"):
            list(export(tmp_path / "place.db", tmp_path / "out"))
    assert (tmp_path / "out").exists() == there and not list(tmp_path.glob("out/*"))
    assert len(list(export(tmp_path / "place.db", tmp_path / "out"))) == 5


def test_a_label_too_long_for_the_name_of_a_file_is_cut_there_and_whole_in_the_map(tmp_path: Path) -> None:
    first, *_, content = export(_store_of(tmp_path / "place.db", "ü" * 200), tmp_path / "out")
    assert first.parent.name == "00001_" + "ü" * 100
    assert json.loads(content.read_text())["landmarks"][0]["label"] == "ü" * 200


def test_a_folder_that_holds_something_is_refused_and_left_as_it_is(tmp_path: Path) -> None:
    Store(tmp_path / "place.db").close()
    used = tmp_path / "used"
    used.mkdir()
    assert [file.name for file in export(tmp_path / "place.db", used)] == ["map.json"]  # an empty one is good
    before = (used / "map.json").stat().st_mtime_ns
    with pytest.raises(OSError, match=r"used: expected a new or empty folder, got one that .* choose another"):
        next(export(tmp_path / "place.db", used))
    assert [(file.name, file.stat().st_mtime_ns) for file in used.iterdir()] == [("map.json", before)]


def test_an_export_with_its_map_has_that_beside_the_rest_or_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError("no space left")

    _store_of(tmp_path / "place.db", "cup")
    written = list(export(tmp_path / "place.db", tmp_path / "out", grid=GridParams()))
    assert {"map.json", "map.pgm", "map.yaml", "map.ply", "landmarks.json"} <= {file.name for file in written}
    assert all(file.is_file() for file in written)
    monkeypatch.setattr("objreg_tools.report.exports.map_folder.landmark_places", refuse)
    with pytest.raises(OSError, match="no space left"):
        list(export(tmp_path / "place.db", tmp_path / "again", grid=GridParams()))
    assert not (tmp_path / "again").exists()
