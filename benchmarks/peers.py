# SPDX-License-Identifier: Apache-2.0
"""What a user would otherwise pick: ways to register two RGB-D frames, each as its usual implementation does it.

Every peer prepares a frame once and registers pairs of prepared frames. It answers with ``T_from_to`` and says itself
whether it would accept it, by the test that is usual for it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import click
import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import ObjectCloud
from objreg_ros.data.images import DepthImage
from objreg_ros.geometry import back_project, pose, rotation_from_vector

FEATURES = 1000  # of an image, at most
MIN_FEATURES = 20  # inliers of PnP, as RTAB-Map's Vis/MinInliers
MIN_FITNESS = 0.4  # of whole-frame ICP
PAPER_ERROR = 0.005  # m, what the founding document calls good
PAPER_ITERATIONS = 100  # of its ICP, at most
VOXEL = 0.05  # m, of whole-frame features
FAR = 4.0  # m, a Kinect's depth beyond is not used


@dataclass(frozen=True, eq=False)
class Shot:
    """A frame as a peer gets it: the whole image, and the objects that the detector and the founding filter give."""

    image: DepthImage
    objects: tuple[ObjectCloud, ...] = ()


class Answer(NamedTuple):
    """``T_from_to (4, 4)``, and whether the peer believes it."""

    T_from_to: Array
    accepted: bool


class Peer(Protocol):
    """One way to register two frames."""

    name: str

    def prepare(self, shot: Shot) -> Any:
        """What is computed once a frame."""

    def register(self, first: Any, second: Any) -> Answer | None:
        """``T_from_to`` with *from* the first and *to* the second; None if there is none."""


class FeaturesPnP:
    """ORB or SIFT features, mutual nearest neighbours, PnP with RANSAC: what feature-based SLAM does."""

    def __init__(self, name: str) -> None:
        self.name = name
        sift = name.startswith("sift")
        self._detector = cv2.SIFT_create(FEATURES) if sift else cv2.ORB_create(FEATURES)
        self._matcher = cv2.BFMatcher(cv2.NORM_L2 if sift else cv2.NORM_HAMMING, crossCheck=True)

    def prepare(self, shot: Shot) -> tuple[Array, Array, Any, Array]:
        """Pixels, 3-D points (0 0 0 where depth is missing), descriptors, and the camera matrix."""
        assert shot.image.rgb is not None
        camera = shot.image.intrinsics
        K = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
        grey = cv2.cvtColor(np.ascontiguousarray(shot.image.rgb), cv2.COLOR_RGB2GRAY)
        keypoints, descriptors = self._detector.detectAndCompute(grey, None)
        uv = np.array([k.pt for k in keypoints], np.float64).reshape(-1, 2)
        column, row = np.rint(uv).astype(int).T if len(uv) else (np.zeros(0, int),) * 2
        z = shot.image.depth[row, column].astype(np.float64)
        xyz = np.column_stack([(uv[:, 0] - camera.cx) / camera.fx * z, (uv[:, 1] - camera.cy) / camera.fy * z, z])
        return uv, xyz, descriptors, K

    def register(self, first: Any, second: Any) -> Answer | None:
        """The second's 3-D points against the first's pixels."""
        uv, _, wanted, K = first
        _, xyz, found, _ = second
        if wanted is None or found is None:
            return None
        matches = [m for m in self._matcher.match(found, wanted) if 0 < xyz[m.queryIdx, 2] < FAR]
        if len(matches) < 6:
            return None
        points = np.array([xyz[m.queryIdx] for m in matches])
        pixels = np.array([uv[m.trainIdx] for m in matches])
        cv2.setRNGSeed(0)
        good, turn, shift, inliers = cv2.solvePnPRansac(
            points, pixels, K, None, iterationsCount=300, reprojectionError=3.0, confidence=0.99
        )
        if not good or inliers is None or not np.isfinite(shift).all():
            return None
        return Answer(pose(rotation_from_vector(turn.ravel()), shift.ravel()), len(inliers) >= MIN_FEATURES)


class WholeFrame:
    """FPFH features of the whole frame, RANSAC, point-to-plane ICP: Open3D's global registration."""

    name = "fpfh_icp"

    def prepare(self, shot: Shot) -> tuple[Any, Any]:
        """A downsampled cloud with normals, and its features."""
        import open3d as o3d

        camera = shot.image.intrinsics
        xyz = back_project(shot.image.depth, camera.fx, camera.fy, camera.cx, camera.cy)
        xyz = xyz[(shot.image.depth > 0) & (shot.image.depth < FAR)]
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(xyz.astype(np.float64)))
        cloud = cloud.voxel_down_sample(VOXEL)
        cloud.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(2 * VOXEL, 30))
        cloud.orient_normals_towards_camera_location(np.zeros(3))
        search = o3d.geometry.KDTreeSearchParamHybrid(5 * VOXEL, 100)
        return cloud, o3d.pipelines.registration.compute_fpfh_feature(cloud, search)

    def register(self, first: Any, second: Any) -> Answer | None:
        """RANSAC over feature matches, then ICP."""
        import open3d as o3d

        (target, target_features), (source, source_features) = first, second
        if len(source.points) < 50 or len(target.points) < 50:
            return None
        registration = o3d.pipelines.registration
        o3d.utility.random.seed(0)
        checks = [
            registration.CorrespondenceCheckerBasedOnEdgeLength(0.9),
            registration.CorrespondenceCheckerBasedOnDistance(1.5 * VOXEL),
        ]
        coarse = registration.registration_ransac_based_on_feature_matching(
            source,
            target,
            source_features,
            target_features,
            True,
            1.5 * VOXEL,
            registration.TransformationEstimationPointToPoint(False),
            3,
            checks,
            registration.RANSACConvergenceCriteria(50_000, 0.999),
        )
        plane = registration.TransformationEstimationPointToPlane()
        fine = registration.registration_icp(source, target, VOXEL, coarse.transformation, plane)
        return Answer(np.array(fine.transformation), fine.fitness >= MIN_FITNESS)


class Founding:
    """The founding document: point-to-point ICP of one object's clouds from where they are, accepted by its error."""

    name = "paper"

    def prepare(self, shot: Shot) -> list[tuple[str, Any]]:
        """The objects as clouds, with their labels."""
        import open3d as o3d

        return [
            (cloud.label, o3d.geometry.PointCloud(o3d.utility.Vector3dVector(cloud.xyz.astype(np.float64))))
            for cloud in shot.objects
            if len(cloud) >= 30
        ]

    def register(self, first: Any, second: Any) -> Answer | None:
        """The pair of objects of one label that fits best."""
        fits = [self.fit(target, source) for a, target in first for b, source in second if a == b]
        if not fits:
            return None
        error, T_from_to = min(fits, key=lambda item: item[0])
        return Answer(T_from_to, error < PAPER_ERROR)

    def fit(self, target: Any, source: Any) -> tuple[float, Array]:
        """(mean distance to the closest point in m, ``T_target_source``): the document's error and answer."""
        import open3d as o3d

        registration = o3d.pipelines.registration
        result = registration.registration_icp(
            source,
            target,
            1.0,
            np.eye(4),
            registration.TransformationEstimationPointToPoint(False),
            registration.ICPConvergenceCriteria(1e-7, 1e-7, PAPER_ITERATIONS),
        )
        T = np.array(result.transformation)
        moved = o3d.geometry.PointCloud(source).transform(T)
        return float(np.mean(moved.compute_point_cloud_distance(target))), T


PEERS: dict[str, Callable[[], Peer]] = {
    "orb_pnp": lambda: FeaturesPnP("orb_pnp"),
    "sift_pnp": lambda: FeaturesPnP("sift_pnp"),
    "fpfh_icp": WholeFrame,
    "paper": Founding,
}


def named(context: click.Context, option: click.Parameter, text: str) -> tuple[str, ...]:
    """The names of ``PEERS`` that an option lists, commas between; `click.BadParameter` for one that there is not."""
    names = tuple(name for name in text.split(",") if name)
    unknown = sorted(set(names) - set(PEERS))
    if unknown:
        raise click.BadParameter(f"expected peers of {', '.join(PEERS)}, got {', '.join(unknown)}")
    return names
