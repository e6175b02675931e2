# SPDX-License-Identifier: Apache-2.0
"""What docs/conventions.md says of frames, orders and units holds, by its own example and by numbers."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from objreg_mapper.constraint import Constraint, inverted, local_covariance, local_information, rotation_first
from objreg_mapper.formats import g2o, kitti, tum
from objreg_mapper.formats.pose_graph_tools import fill_edge
from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import (
    back_project,
    inverse,
    mounting,
    pose,
    quaternion_from_rotation,
    rotate,
    rotation_from_vector,
    transform,
    vector_from_rotation,
)

STAMP_NS = 1_795_000_000_500_000_000
T_FROM_TO = pose(rotation_from_vector(np.array([0.0, 0.0, np.pi / 2])), np.array([0.1, 0.2, 2.0]))
SIGMAS = np.array([0.01, 0.02, 0.03, 0.04, 0.05, 0.06])
CLOSURE = LoopClosure(from_ns=0, to_ns=STAMP_NS, T_from_to=T_FROM_TO, covariance=np.diag(SIGMAS**2), labels=())
CONSTRAINT = Constraint(CLOSURE.T_from_to, CLOSURE.covariance)
SAMPLES = 20_000


def lines(repository: Path, form: str) -> list[str]:
    """What the example of the page has of a format."""
    page = (repository / "docs/conventions.md").read_text(encoding="utf-8")
    example = page.partition("```text\n")[2].partition("```")[0].splitlines()
    return [line.removeprefix(form).strip() for line in example if line.startswith(f"{form} ")]


def numbers(text: str) -> list[float]:
    """The numbers of a line of text."""
    parts = text.replace(",", " ").split()
    return [float(part) for part in parts if part.lstrip("-").replace(".", "").isdecimal()]


def wrong_poses(rng: np.random.Generator) -> list[np.ndarray]:
    """Poses that are off by the covariance of the example, as the page says what its numbers mean."""
    errors = rng.normal(size=(SAMPLES, 6)) * SIGMAS * 0.1  # small, so that first order is enough
    return [pose(rotation_from_vector(e[3:]) @ T_FROM_TO[:3, :3], T_FROM_TO[:3, 3] + e[:3]) for e in errors]


def test_a_message_has_the_numbers_of_the_page(repository: Path) -> None:
    pytest.importorskip("nav_msgs", reason="ROS is not there")
    from objreg_ros.bridge.messages import to_msg

    of_pose, of_covariance = lines(repository, "ROS")
    message = to_msg.constraint(CLOSURE)
    position, turn = message.pose.pose.position, message.pose.pose.orientation
    given = [position.x, position.y, position.z, turn.x, turn.y, turn.z, turn.w]
    np.testing.assert_allclose(given, numbers(of_pose), atol=1e-6)
    np.testing.assert_allclose(np.diag(np.reshape(message.pose.covariance, (6, 6))), numbers(of_covariance))
    assert message.child_frame_id == "camera@1795000000.500000000"
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == divmod(STAMP_NS, 10**9)


def test_files_have_the_lines_of_the_page(repository: Path) -> None:
    assert [tum.trajectory_text([(STAMP_NS, T_FROM_TO)]).strip()] == lines(repository, "TUM")
    assert [kitti.trajectory_text([T_FROM_TO]).strip()] == lines(repository, "KITTI")
    (edge,) = lines(repository, "g2o")
    written = g2o.edge_text(0, 1, CONSTRAINT).split()
    assert written[:10] == edge.split()[:10]
    np.testing.assert_allclose(np.array(written[3:], float), np.array(edge.split()[3:], float), atol=1e-8)


def test_gtsam_has_rotation_first_and_the_axes_of_to(repository: Path) -> None:
    (of_gtsam,) = lines(repository, "GTSAM")
    sigmas = np.sqrt(np.diag(rotation_first(local_covariance(CONSTRAINT))))
    np.testing.assert_allclose(sigmas, numbers(of_gtsam), atol=1e-9)


def test_hydra_gets_the_inverse(repository: Path) -> None:
    (of_hydra,) = lines(repository, "Hydra")
    point, turn = SimpleNamespace(), SimpleNamespace()
    edge = fill_edge(SimpleNamespace(pose=SimpleNamespace(position=point, orientation=turn)), CLOSURE, np.eye(4))
    given = [point.x, point.y, point.z, turn.x, turn.y, turn.z, turn.w]
    np.testing.assert_allclose(given, numbers(of_hydra), atol=1e-6)
    np.testing.assert_allclose(np.reshape(edge.covariance, (6, 6)), inverted(CONSTRAINT).covariance)


def test_the_covariance_is_of_turns_about_the_axes_of_from_that_leave_the_translation_alone() -> None:
    """Right steps `T exp(xi)` of the wrong poses scatter as `local_covariance` says, and those of the inverse too."""
    rng = np.random.default_rng(5)
    wrong = wrong_poses(rng)
    steps = [inverse(T_FROM_TO) @ T for T in wrong]
    local = np.array([[*T[:3, 3], *vector_from_rotation(T[:3, :3])] for T in steps])
    assert_scatter(local, 0.01 * local_covariance(CONSTRAINT))
    back = [inverse(T) for T in wrong]
    R, t = inverse(T_FROM_TO)[:3, :3], inverse(T_FROM_TO)[:3, 3]
    errors = np.array([[*(T[:3, 3] - t), *vector_from_rotation(T[:3, :3] @ R.T)] for T in back])
    assert_scatter(errors, 0.01 * inverted(CONSTRAINT).covariance)


def assert_scatter(errors: np.ndarray, expected: np.ndarray) -> None:
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(np.cov(errors.T) / scale, expected / scale, atol=0.04)


def test_gtsam_finds_the_wrong_poses_as_far_off_as_the_covariance_says(tmp_path: Path) -> None:
    """The mean of half the squared error in deviations is half the number of freedoms: of the file, read by GTSAM."""
    gtsam = pytest.importorskip("gtsam", reason="gtsam is not installed")
    file = tmp_path / "map.g2o"
    file.write_text(g2o.graph_text([np.eye(4), T_FROM_TO], [(0, 1, CONSTRAINT)]))
    graph, poses = gtsam.readG2o(str(file), True)
    costs = []
    for T in wrong_poses(np.random.default_rng(6))[:4000]:
        poses.update(1, gtsam.Pose3(T))
        costs.append(graph.error(poses))
    assert 100.0 * np.mean(costs) == pytest.approx(3.0, rel=0.06)


def test_ceres_counts_in_the_axes_of_from_and_rotations_the_other_way_round() -> None:
    """Its pose_graph_3d compares positions in *from*, and takes twice the vector of measured times estimated^-1."""
    error = np.array([0.01, -0.02, 0.03, 0.004, 0.005, -0.006])
    estimated = pose(rotation_from_vector(error[3:]) @ T_FROM_TO[:3, :3], T_FROM_TO[:3, 3] + error[:3])
    turned = quaternion_from_rotation(T_FROM_TO[:3, :3] @ estimated[:3, :3].T)
    residual = [*(estimated[:3, 3] - T_FROM_TO[:3, 3]), *(2.0 * turned[:3])]
    np.testing.assert_allclose(residual, [*error[:3], *-error[3:]], atol=1e-6)


def test_the_information_is_the_inverse_of_the_covariance_in_the_axes_of_to() -> None:
    np.testing.assert_allclose(local_information(CONSTRAINT) @ local_covariance(CONSTRAINT), np.eye(6), atol=1e-9)


def test_a_pose_maps_points_of_its_second_name_into_its_first() -> None:
    ahead_of_to = np.array([0.5, 0.0, 1.0])
    np.testing.assert_allclose(transform(T_FROM_TO, ahead_of_to), [0.1, 0.7, 3.0], atol=1e-12)


def test_a_camera_that_looks_ahead_has_the_rotation_of_the_page() -> None:
    T_base_camera = mounting((0.0, 0.0, 0.0, -0.5, 0.5, -0.5, 0.5))
    assert T_base_camera is not None
    right, down, forward = rotate(T_base_camera, np.eye(3))
    np.testing.assert_allclose([right, down, forward], [[0, -1, 0], [0, 0, -1], [1, 0, 0]], atol=1e-12)


def test_depth_is_along_the_optical_axis_and_pixel_centres_are_on_integers() -> None:
    camera = Intrinsics(fx=100.0, fy=100.0, cx=1.5, cy=1.0, width=4, height=3)
    xyz = back_project(np.full((3, 4), 2.0), camera.fx, camera.fy, camera.cx, camera.cy)
    np.testing.assert_allclose(xyz[..., 2], 2.0)
    np.testing.assert_allclose(xyz[1, 0], [-0.03, 0.0, 2.0])  # the column of 0 is 1.5 left of the axis
    np.testing.assert_allclose(xyz[1].mean(axis=0), [0.0, 0.0, 2.0], atol=1e-12)  # the middle of four columns is 1.5
