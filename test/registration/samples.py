# SPDX-License-Identifier: Apache-2.0
"""Small made-up keyframes and candidates for the tests of registration."""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import Alignment
from objreg_ros.data.frames import Frame, ObjectCloud, View
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import back_project, inverse, pose, transform
from objreg_ros.registration.candidate import Candidate, ObjectPair, Verification
from objreg_ros.registration.keyframe import Context, Keyframe, KeyObject

CAMERA = Intrinsics(fx=131.25, fy=131.25, cx=79.625, cy=59.625, width=160, height=120)
SECOND = 1_000_000_000


def box(label: str, centre: tuple[float, float, float], side: float = 0.1, instance: int = 1) -> ObjectCloud:
    """A cube of points, the same for the same arguments."""
    xyz = (np.random.default_rng(3).random((400, 3)) - 0.5) * side + centre
    shade = np.full((400, 3), 40 + 60 * (len(label) % 3), np.uint8)
    return cloud(label, xyz, instance, shade)


def cloud(label: str, xyz: Array, instance: int = 1, rgb: Array | None = None) -> ObjectCloud:
    """Any points as an object."""
    points = xyz.astype(np.float32)
    normals = np.tile(np.float32([0, 0, -1]), (len(points), 1))
    flags = np.zeros(len(points), np.uint16)
    return ObjectCloud(
        label=label, score=0.9, instance=instance, xyz=points, normals=normals, rgb=rgb, flags=flags, density=1e4
    )


def scene_view(T_world_camera: Array | None = None) -> View:
    """What a camera sees of a room without end: a wall at z = 2 m with a bump, a floor at y = 0.8 m, both painted."""
    T = np.eye(4) if T_world_camera is None else T_world_camera
    ray = back_project(np.ones((120, 160)), CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy) @ T[:3, :3].T
    origin = T[:3, 3]
    wall, floor = (2.0 - origin[2]) / ray[..., 2], (0.8 - origin[1]) / ray[..., 1]
    depth = np.where((floor > 0) & (floor < wall), floor, wall)
    for _ in range(6):  # the bump is part of the wall: a few fixed-point steps put the ray upon it
        at = origin + depth[..., None] * ray
        bump = 0.3 * np.exp(-((at[..., 0] - 0.2) ** 2 + (at[..., 1] + 0.1) ** 2) / 0.08)
        depth = np.where(at[..., 1] < 0.79, (2.0 - bump - origin[2]) / ray[..., 2], depth)
        depth = np.where((floor > 0) & (floor < depth), floor, depth)
    world = origin + depth[..., None] * ray
    grey = 128 + 50 * np.sin(9 * world[..., 0]) + 50 * np.sin(11 * world[..., 1] + 7 * world[..., 2])
    xyz = transform(inverse(T), world).astype(np.float32)
    return View(xyz=xyz, grey=np.clip(grey, 0, 255).astype(np.uint8), intrinsics=CAMERA)


def frame(
    seconds: float,
    objects: tuple[ObjectCloud, ...] = (),
    T_odom_camera: Array | None = None,
    view: View | None = None,
) -> Frame:
    """A frame at ``seconds`` that looks at the scene from the origin."""
    return Frame(
        objects=objects,
        support=None,
        view=view or scene_view(),
        gravity=np.array([0.0, 1.0, 0.0]),
        gravity_confidence=1.0,
        T_odom_camera=T_odom_camera,
        stamp_ns=round(seconds * SECOND),
    )


def keyframe(
    keyframe_id: int = 1,
    seconds: float = 0.0,
    objects: tuple[ObjectCloud, ...] | None = None,
    session: int = 0,
    T_odom_camera: Array | None = None,
) -> Keyframe:
    """A stored keyframe of the scene."""
    view = scene_view()
    xyz = view.xyz.reshape(-1, 3)[::20]
    shown = (box("cup", (0, 0, 1)),) if objects is None else objects
    return Keyframe(
        keyframe_id=keyframe_id,
        session=session,
        stamp_ns=round(seconds * SECOND),
        frame_id="camera",
        objects=tuple(KeyObject(cloud=item) for item in shown),
        context=Context(xyz=xyz, normals=np.tile(np.float32([0, 0, -1]), (len(xyz), 1))),
        view=view,
        gravity=np.array([0.0, 1.0, 0.0]),
        gravity_confidence=1.0,
        T_odom_camera=np.eye(4) if T_odom_camera is None else T_odom_camera,
    )


def moved(x: float, y: float = 0.0, z: float = 0.0) -> Array:
    """A pose without rotation."""
    return pose(np.eye(3), np.array([x, y, z]))


def candidate(T: Array | None = None, **evidence: object) -> Candidate:
    """A candidate that is most likely right, and breaks no rule, but for what is given otherwise."""
    seen = {"inliers": 0.9, "violations": 0.01, "occluded": 0.05, "correlation": 0.6, "tested": 9000, "score": 0.8}
    seen.update({name: evidence.pop(name) for name in list(evidence) if name in seen})
    information = evidence.pop("information", np.diag([1e5] * 3 + [1e5] * 3))
    alignment = Alignment(
        T_target_source=np.eye(4) if T is None else T,
        information=information,
        inliers=900,
        overlap=0.7,
        rmse=0.01,
        converged=bool(evidence.pop("converged", True)),
        degenerate=evidence.pop("degenerate", np.zeros((0, 6))),
        regularised=evidence.pop("regularised", np.zeros((0, 6))),
        middle=evidence.pop("middle", np.zeros(3)),
    )
    rest: dict[str, object] = {
        "proposer": "objects",
        "agreeing_proposers": ("features", "objects"),
        "matched": (ObjectPair(0, 0, "cup"), ObjectPair(1, 1, "book")),
        "gravity_error_deg": 0.5,
        "certain_violations": 0.0,
        "score_margin": 1.0,
        "perturbation_margin": 0.6,
        "silhouettes": evidence.get("silhouette_score"),
    }
    rest.update(evidence)
    return Candidate(alignment=alignment, verification=Verification(**seen), **rest)
