# SPDX-License-Identifier: Apache-2.0
"""Usual ways to register two object clouds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import is_rigid, pose

Peer = Callable[[Array, Array], Array]


def cloud_peers() -> dict[str, Peer]:
    """Usual ways to register two object clouds; each maps (source, target) to ``T_target_source``."""
    import open3d as o3d
    import small_gicp

    registration, near = o3d.pipelines.registration, 0.1

    def made(points: Array) -> Any:
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)).voxel_down_sample(0.005)
        cloud.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(0.02, 30))
        cloud.orient_normals_towards_camera_location(np.zeros(3))
        return cloud

    def centred(source: Array, target: Array) -> Array:
        return pose(np.eye(3), target.mean(axis=0) - source.mean(axis=0))

    def icp(source: Array, target: Array) -> Array:
        result = registration.registration_icp(
            made(source), made(target), 1.0, np.eye(4), registration.TransformationEstimationPointToPoint()
        )
        return np.array(result.transformation)

    def plane(source: Array, target: Array) -> Array:
        start, error = centred(source, target), registration.TransformationEstimationPointToPlane()
        return np.array(registration.registration_icp(made(source), made(target), near, start, error).transformation)

    def gicp(source: Array, target: Array) -> Array:
        result = small_gicp.align(
            target, source, centred(source, target), downsampling_resolution=0.005, max_correspondence_distance=near
        )
        return np.array(result.T_target_source)

    def fpfh(source: Array, target: Array) -> Array:
        clouds = made(source), made(target)
        search = o3d.geometry.KDTreeSearchParamHybrid(0.05, 100)
        features = [registration.compute_fpfh_feature(cloud, search) for cloud in clouds]
        o3d.utility.random.seed(0)
        coarse = registration.registration_ransac_based_on_feature_matching(
            *clouds, *features, True, 0.01, registration.TransformationEstimationPointToPoint(False), 3,
            [registration.CorrespondenceCheckerBasedOnEdgeLength(0.9)],
            registration.RANSACConvergenceCriteria(50_000, 0.999),
        )  # fmt: skip
        result = small_gicp.align(
            target, source, coarse.transformation, downsampling_resolution=0.005, max_correspondence_distance=0.02
        )
        return np.array(result.T_target_source)

    return {"founding_icp": icp, "point_to_plane": plane, "small_gicp": gicp, "fpfh_ransac_gicp": fpfh} | kiss(0.005)


def kiss(voxel: float) -> dict[str, Peer]:
    """KISS-Matcher (Lim et al., 2025), in cm since it takes no voxels of mm, then GICP; nothing if not installed."""
    try:
        import kiss_matcher
    except ImportError:
        return {}
    import small_gicp

    def register(source: Array, target: Array) -> Array:
        matcher = kiss_matcher.KISSMatcher(kiss_matcher.KISSMatcherConfig(100.0 * voxel))
        found = matcher.estimate(*(list((100.0 * points).astype(np.float32)) for points in (source, target)))
        coarse = pose(np.array(found.rotation), np.array(found.translation).ravel() / 100.0)
        if not is_rigid(coarse, 1e-3):
            return np.eye(4)
        result = small_gicp.align(
            target, source, coarse, downsampling_resolution=voxel, max_correspondence_distance=0.02
        )
        return np.array(result.T_target_source)

    return {"kiss_matcher_gicp": register}
