# SPDX-License-Identifier: Apache-2.0
"""What is written is what g2o's readers expect."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from objreg_mapper.formats.g2o import edge_text, graph_text, times_file, times_text
from objreg_ros.geometry import pose, pose_error, rotation_from_vector

from .blank import CONSTRAINT, LOCAL_INFORMATION_DIAGONAL, QUARTER_LEFT

HALF = np.sqrt(0.5)


def test_an_edge_has_ids_pose_and_the_upper_triangle_translation_first() -> None:
    tag, a, b, *numbers = edge_text(3, 8, CONSTRAINT).split()
    assert (tag, a, b, len(numbers)) == ("EDGE_SE3:QUAT", "3", "8", 7 + 21)
    values = np.array(numbers, float)
    np.testing.assert_allclose(values[:7], [1, 2, 3, 0, 0, HALF, HALF], atol=1e-8)
    upper = np.zeros((6, 6))
    upper[np.triu_indices(6)] = values[7:]
    np.testing.assert_allclose(upper, np.diag(LOCAL_INFORMATION_DIAGONAL), atol=1e-12)


def test_a_graph_lists_its_vertices_and_then_its_edges_and_nothing_else() -> None:
    lines = graph_text([np.eye(4), QUARTER_LEFT], [(0, 1, CONSTRAINT)]).splitlines()
    assert [line.split()[:2] for line in lines] == [
        ["VERTEX_SE3:QUAT", "0"],
        ["VERTEX_SE3:QUAT", "1"],
        ["EDGE_SE3:QUAT", "0"],
    ]
    assert graph_text([], []) == ""


def test_gtsam_reads_the_poses_and_the_information_that_were_written(tmp_path: Path) -> None:
    gtsam = pytest.importorskip("gtsam", reason="gtsam is not installed")
    file = tmp_path / "map.g2o"
    file.write_text(graph_text([np.eye(4), QUARTER_LEFT], [(0, 1, CONSTRAINT)]))
    graph, poses = gtsam.readG2o(str(file), True)
    assert (graph.size(), poses.size()) == (1, 2)
    assert max(pose_error(poses.atPose3(1).matrix(), QUARTER_LEFT)) < 1e-6
    factor = graph.at(0)
    assert max(pose_error(factor.measured().matrix(), CONSTRAINT.T_from_to)) < 1e-6
    rotation_first = np.roll(LOCAL_INFORMATION_DIAGONAL, 3)
    np.testing.assert_allclose(np.diag(factor.noiseModel().information()), rotation_first, rtol=1e-6)


def test_g2o_itself_reads_what_was_written_and_takes_rotations_for_half_as_much(tmp_path: Path) -> None:
    g2o = pytest.importorskip("g2opy", reason="g2opy is not installed")
    file = tmp_path / "map.g2o"
    file.write_text(graph_text([np.eye(4), QUARTER_LEFT], [(0, 1, CONSTRAINT)]))
    graph = g2o.SparseOptimizer()
    assert graph.load(str(file))
    (edge,), vertices = graph.edges(), graph.vertices()
    assert max(pose_error(np.array(vertices[1].estimate().matrix()), QUARTER_LEFT)) < 1e-6
    np.testing.assert_allclose(edge.information(), np.diag(LOCAL_INFORMATION_DIAGONAL), atol=1e-9)
    for k, share in [(0, 1.0), (1, 1.0), (2, 1.0), (3, 0.25), (4, 0.25), (5, 0.25)]:
        step = 0.01 * np.eye(6)[k]
        moved = QUARTER_LEFT @ pose(rotation_from_vector(step[3:]), step[:3])
        vertices[1].set_estimate(g2o.Isometry3d(moved))
        edge.compute_error()
        assert edge.chi2() == pytest.approx(share * 1e-4 * LOCAL_INFORMATION_DIAGONAL[k], rel=1e-3)


def test_the_times_of_the_vertices_are_whole_nanoseconds_in_a_file_beside_it() -> None:
    assert times_file(Path("out/map.g2o")) == Path("out/map.g2o.times.csv")
    assert times_text([(1_795_000_000_123_456_789, 0), (5, 2)]).splitlines() == [
        "vertex,stamp_ns,session",
        "0,1795000000123456789,0",
        "1,5,2",
    ]
