# SPDX-License-Identifier: Apache-2.0
"""Depth images of known shapes: rays against a table, boxes and walls."""

from __future__ import annotations

import numpy as np

from objreg_ros.data.images import DepthImage, Detections, Intrinsics
from objreg_ros.segmenter.params import SegmenterParams
from objreg_ros.segmenter.surface.cells import cell_size, reduce
from objreg_ros.segmenter.surface.support import Ground, find_supports

CAMERA = Intrinsics(fx=525.0, fy=525.0, cx=319.5, cy=239.5, width=640, height=480)
SMALL = Intrinsics(fx=262.5, fy=262.5, cx=159.5, cy=119.5, width=320, height=240)


class Scene:
    """A camera above a table that looks down by ``tilt_deg``; things are added in table coordinates.

    Table coordinates: x right, y forward along the table, z up, the origin on the table ``distance`` metres in front of
    the camera. ``owner`` states which thing each pixel shows: 0 nothing, 1 the table, 2 … the things in their order.
    """

    def __init__(self, camera: Intrinsics = CAMERA, tilt_deg: float = 35.0, distance: float = 1.0) -> None:
        tilt = np.radians(tilt_deg)
        self.camera = camera
        self.up = np.array([0.0, -np.cos(tilt), -np.sin(tilt)])
        forward = np.array([0.0, -np.sin(tilt), np.cos(tilt)])
        self.R = np.stack([np.array([1.0, 0.0, 0.0]), forward, self.up])  # camera to table axes
        self.eye = -self.R @ np.array([0.0, 0.0, distance])
        u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
        rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)], axis=-1)
        self.rays = rays @ self.R.T
        self.depth = np.full(u.shape, np.inf)
        self.owner = np.zeros(u.shape, int)
        self.count = 0

    def plane(self, z: float = 0.0, x: tuple[float, float] = (-9, 9), y: tuple[float, float] = (-9, 9)) -> Scene:
        """A level surface of height ``z``."""
        return self.box((x[0], y[0], z - 0.001), (x[1], y[1], z))

    def box(self, low: tuple[float, float, float], high: tuple[float, float, float]) -> Scene:
        """An upright box between two corners (slab test of each ray)."""
        near, far = np.full(self.depth.shape, -np.inf), np.full(self.depth.shape, np.inf)
        for k in range(3):  # axis by axis: to reduce an axis of three takes five times as long
            with np.errstate(divide="ignore", invalid="ignore"):
                a, b = (low[k] - self.eye[k]) / self.rays[..., k], (high[k] - self.eye[k]) / self.rays[..., k]
            near, far = np.maximum(near, np.fmin(a, b)), np.minimum(far, np.fmax(a, b))
        self.count += 1
        seen = (near < far) & (near > 0) & (near < self.depth)
        self.depth[seen], self.owner[seen] = near[seen], self.count
        return self

    def image(self, noise: float = 0.0, seed: int = 0) -> DepthImage:
        """The depth image with Gaussian noise of ``noise`` · z² metres; unseen pixels are 0."""
        depth = np.where(np.isfinite(self.depth), self.depth, 0.0)
        depth = depth + np.random.default_rng(seed).normal(0, 1, depth.shape) * noise * depth**2
        palette = np.array([(40, 40, 40), (150, 140, 120), (200, 40, 40), (40, 80, 200), (60, 190, 60)])
        speckle = np.random.default_rng(seed).integers(0, 30, (*depth.shape, 3))
        rgb = (palette[np.minimum(self.owner, 4)] + speckle).astype(np.uint8)
        return DepthImage(depth=depth.astype(np.float32), rgb=rgb, intrinsics=self.camera, stamp_ns=7, frame_id="eye")

    def ground(self, image: DepthImage) -> Ground:
        """What the segmenter knows of a whole image of the scene where up is given."""
        params = SegmenterParams()
        limits, jump = params.limits, params.jump_bounds
        surface = reduce(image.depth, self.camera, cell_size(*image.depth.shape), limits, jump)
        coarse = surface.every(2)
        supports = find_supports(coarse, self.camera, self.up, params.support_area, jump)
        return Ground(self.up, 1.0, supports, surface, coarse)

    def box_of(self, *owners: int, pad: float = 0.08) -> tuple[float, float, float, float]:
        """The padded image box (x0, y0, x1, y1) of the things with these numbers."""
        rows, cols = np.nonzero(np.isin(self.owner, owners))
        w, h = pad * np.ptp(cols), pad * np.ptp(rows)
        width, height = self.camera.width, self.camera.height
        return (
            max(0.0, cols.min() - w),
            max(0.0, rows.min() - h),
            min(float(width), cols.max() + 1 + w),
            min(float(height), rows.max() + 1 + h),
        )

    def detections(self, *boxes: tuple[float, float, float, float]) -> Detections:
        """Detections of these boxes, labelled by their order."""
        return Detections(
            xyxy=np.array(boxes, np.float32).reshape(-1, 4),
            score=np.full(len(boxes), 0.9, np.float32),
            label=tuple(str(k) for k in range(len(boxes))),
            image_hw=(self.camera.height, self.camera.width),
            stamp_ns=7,
            frame_id="eye",
        )

    def pixels(self, xyz: np.ndarray) -> np.ndarray:
        """(H, W) bool: the pixels of points (N, 3)."""
        camera, mask = self.camera, np.zeros(self.depth.shape, bool)
        u = np.rint(xyz[:, 0] / xyz[:, 2] * camera.fx + camera.cx).astype(int)
        v = np.rint(xyz[:, 1] / xyz[:, 2] * camera.fy + camera.cy).astype(int)
        mask[v, u] = True
        return mask

    def iou(self, xyz: np.ndarray, owner: int) -> float:
        """Intersection over union of points (N, 3) and the pixels that show ``owner``."""
        mask, truth = self.pixels(xyz), self.owner == owner
        return float((mask & truth).sum() / (mask | truth).sum())


def two_boxes() -> Scene:
    """A table (1), a tall box (2) to the left and a low one (3) to the right."""
    return Scene().plane().box((-0.25, -0.05, 0), (-0.15, 0.05, 0.2)).box((0.1, -0.1, 0), (0.3, 0.1, 0.06))
