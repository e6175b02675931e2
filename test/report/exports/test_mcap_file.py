# SPDX-License-Identifier: Apache-2.0
"""A run as an MCAP file, read back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from objreg_ros.bridge.messages import from_msg, headers
from objreg_tools.report.exports.mcap_file import write_mcap
from report.runs import COUNT, STEP_NS
from report.scenes import SEEN, walk


@pytest.fixture(scope="module")
def read(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list]:
    """The messages of each topic of a run."""
    folder = tmp_path_factory.mktemp("mcap")
    assert write_mcap(folder / "run.mcap", walk()) == len(SEEN)
    assert [file.name for file in folder.iterdir()] == ["run.mcap"]
    found: dict[str, list] = {}
    with AnyReader([folder / "run.mcap"]) as reader:
        stamps = []
        for connection, stamp_ns, raw in reader.messages():
            found.setdefault(connection.topic, []).append(reader.deserialize(raw, connection.msgtype))
            stamps.append(stamp_ns)
        assert stamps == sorted(stamps)
    return found


def test_the_three_ways_are_paths(read: dict[str, list]) -> None:
    scene = walk()
    for name, way in scene.trajectories.items():
        (path,) = read[f"/trajectory/{name}"]
        places = np.array([[p.pose.position.x, p.pose.position.y, p.pose.position.z] for p in path.poses])
        assert path.header.frame_id == "map" and np.allclose(places, way.positions)


def test_closures_are_lines_by_verdict_with_their_errors_beside_them(read: dict[str, list]) -> None:
    (array,) = read["/closures"]
    lines = {marker.ns: len(marker.points) // 2 for marker in array.markers if marker.points}
    texts = [marker.text for marker in array.markers if marker.text]
    edges = walk().edges
    assert lines == {v: sum(e.verdict == v for e in edges) for v in {edge.verdict for edge in edges}}
    assert "false" in lines and texts == [edge.text for edge in edges]


def test_objects_are_where_they_were_seen(read: dict[str, list]) -> None:
    (array,) = read["/objects"]
    seen = {marker.ns: len(marker.points) for marker in array.markers if marker.points}
    labels = [label for label, _ in walk().objects]
    assert seen == {label: labels.count(label) for label in ("book", "cup")}


def test_no_marker_takes_the_place_of_another_whatever_a_label_is(tmp_path: Path) -> None:
    scene = walk()
    named = {"cup": "names", "book": "words"}
    renamed = replace(scene, objects=tuple((named[label], xyz) for label, xyz in scene.objects))
    write_mcap(tmp_path / "run.mcap", renamed)
    with AnyReader([tmp_path / "run.mcap"]) as reader:
        (raw,) = (raw for connection, _, raw in reader.messages() if connection.topic == "/objects")
        markers = reader.deserialize(raw, "visualization_msgs/msg/MarkerArray").markers
    assert len(markers) == len({(marker.ns, marker.id) for marker in markers}) == 4


def test_the_camera_goes_through_the_map_with_what_it_saw(read: dict[str, list]) -> None:
    assert len(read["/tf"]) == COUNT
    (stamped,) = read["/tf"][30].transforms
    assert (stamped.header.frame_id, stamped.child_frame_id) == ("map", "camera")
    assert stamped.transform.translation.x == pytest.approx(walk().main.positions[30][0])
    image, cloud, info = (read[f"/camera/{name}"][1] for name in ("image/compressed", "points", "camera_info"))
    assert headers.stamp_ns(image) == headers.stamp_ns(cloud) == 30 * STEP_NS
    assert cv2.imdecode(image.data, cv2.IMREAD_COLOR).shape == (info.height, info.width, 3)
    points = from_msg.point_cloud(cloud)
    assert np.allclose(points.xyz[..., 2], 2.0) and (points.rgb == (200, 10, 20)).all()


def test_what_cannot_be_finished_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError("no space left")

    monkeypatch.setattr("objreg_tools.report.exports.mcap_file.write_rosbag2", full)
    with pytest.raises(OSError, match="no space"):
        write_mcap(tmp_path / "run.mcap", walk())
    assert not list(tmp_path.iterdir())


def test_a_link_stays_one(tmp_path: Path) -> None:
    (tmp_path / "link.mcap").symlink_to("run.mcap")
    write_mcap(tmp_path / "link.mcap", walk())
    assert (tmp_path / "link.mcap").is_symlink() and (tmp_path / "run.mcap").stat().st_size
