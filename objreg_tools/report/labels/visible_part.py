# SPDX-License-Identifier: Apache-2.0
"""The part of an object that a picture shows: its points projected, and compared with the depth that was measured.

Where the depth is that of the points the object is seen, where it is nearer something is before it, and where it is
farther the object is not there. Where none was measured it is seen if nothing is before the rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import DepthImage
from objreg_ros.geometry import inverse, rotate, transform
from objreg_ros.sensor import DEPTH_TOLERANCE_GROWTH, DEPTH_TOLERANCE_M
from objreg_tools.report.labels.mapped_objects import MappedObject, ObjectView

VIEWS = 6  # nearest in time of which an object is projected
NEAREST_Z = 0.1  # m
WIDEST = 8  # px of the gap between two points that is closed
GAPS = 1.5  # spacings of points: neighbours in a row that is slanted
UNKNOWN_NEAR = 5  # px from a pixel that is seen: there a lack of depth hides nothing
FREE = 0.9  # of the measured pixels of an outline: where so many are seen, those without depth are too
LEAST_MEASURED = 0.5  # of an outline: of what is measured less than that, what is seen is not known
LEAST_PIECE = 0.1  # of the largest piece of a mask: smaller ones are noise
LEAST_THERE = 0.5  # of the pixels that nothing is before, where the object has to be
LEAST_SIDE = 6  # px of a box


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class VisiblePart:
    """What a picture shows of an object: ``mask (h, w) bool`` with its upper left pixel at ``corner`` (x, y).

    ``off (h, w)`` m is how far the measured depth is from that of the object, infinite outside of the mask. ``share``
    0..1 of its outline is seen; ``whole`` px are in it, those outside the picture among them.
    """

    object: MappedObject
    mask: Array
    corner: tuple[int, int]
    off: Array
    whole: float

    @property
    def pixels(self) -> int:
        """How many pixels show it."""
        return int(self.mask.sum())

    @property
    def share(self) -> float:
        """How much of its outline is seen, 0..1."""
        return min(1.0, self.pixels / max(self.whole, 1.0))

    @property
    def xyxy(self) -> tuple[int, int, int, int]:
        """The box of what is seen, px, half open."""
        rows, columns = np.flatnonzero(self.mask.any(axis=1)), np.flatnonzero(self.mask.any(axis=0))
        x, y = self.corner
        return x + int(columns[0]), y + int(rows[0]), x + int(columns[-1]) + 1, y + int(rows[-1]) + 1

    @property
    def window(self) -> tuple[slice, slice]:
        """The rows and columns of the picture that the mask is of."""
        (x, y), (height, width) = self.corner, self.mask.shape
        return slice(y, y + height), slice(x, x + width)


def visible_part(thing: MappedObject, image: DepthImage, T_map_camera: Array) -> VisiblePart | None:
    """What a picture with depth shows of an object; None where it shows nothing, or free space in its place."""
    drawn = _drawn(thing.near(image.stamp_ns, VIEWS), image, T_map_camera)
    if drawn is None:
        return None
    z, corner, inside = drawn
    (x, y), (height, width) = corner, z.shape
    depth = image.depth[y : y + height, x : x + width]
    outline, known = np.isfinite(z), depth > 0
    off = np.where(outline & known, depth - np.where(outline, z, 0.0), np.inf)
    tolerance = DEPTH_TOLERANCE_M + DEPTH_TOLERANCE_GROWTH * np.where(outline, z, 0.0) ** 2
    agrees, beyond = np.abs(off) <= tolerance, np.isfinite(off) & (off > tolerance)
    if agrees.sum() < LEAST_THERE * (agrees.sum() + beyond.sum()) or not agrees.any():
        return None
    unmeasured = _unmeasured(outline & ~known, agrees, outline & known & ~beyond)
    if unmeasured is None:
        return None
    mask = _without_specks(agrees | unmeasured)
    seen = outline.sum() - (beyond & outline).sum()  # a part that is found to be free is no part of it
    part = VisiblePart(
        object=thing, mask=mask, corner=corner, off=np.where(mask, np.minimum(np.abs(off), 1.0), np.inf),
        whole=float(seen) / inside,
    )  # fmt: skip
    x_min, y_min, x_max, y_max = part.xyxy
    return part if min(x_max - x_min, y_max - y_min) >= LEAST_SIDE else None


def _drawn(
    views: Sequence[ObjectView], image: DepthImage, T_map_camera: Array
) -> tuple[Array, tuple[int, int], float] | None:
    """The depth (h, w) m of the points in a window of the picture, infinite where none is, and the window's corner.

    With the share 0..1 of the points that lie in the picture. None where none does.
    """
    T_camera_map, camera = inverse(T_map_camera), image.intrinsics
    xyz = np.concatenate([transform(T_camera_map, view.xyz) for view in views])
    normals = np.concatenate([rotate(T_camera_map, view.normals) for view in views])
    spacing = float(np.median([view.spacing for view in views]))
    faces = np.einsum("ij,ij->i", xyz, normals) <= 0.0  # those without a normal too
    xyz = xyz[(xyz[:, 2] > NEAREST_Z) & faces]
    u = np.rint(camera.fx * xyz[:, 0] / xyz[:, 2] + camera.cx).astype(int)
    v = np.rint(camera.fy * xyz[:, 1] / xyz[:, 2] + camera.cy).astype(int)
    inside = (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    if inside.sum() < 3:
        return None
    u, v, z = u[inside], v[inside], xyz[inside, 2]
    gap = int(np.clip(np.ceil(GAPS * spacing * camera.fx / float(np.median(z))), 1, WIDEST))
    x, y = max(0, int(u.min()) - gap), max(0, int(v.min()) - gap)
    width, height = min(camera.width, int(u.max()) + gap + 1) - x, min(camera.height, int(v.max()) + gap + 1) - y
    points = np.full((height, width), np.inf, np.float32)
    np.minimum.at(points, (v - y, u - x), z.astype(np.float32))
    return _closed(points, gap), (x, y), float(inside.mean())


def _unmeasured(unknown: Array, agrees: Array, measured: Array) -> Array | None:
    """The pixels (h, w) bool without depth that show the object; None where so many are unknown that nobody can say.

    Depth lacks along borders, on what is dark or shines, and at the sides of a picture that it was registered to.
    """
    around = np.ones((2 * UNKNOWN_NEAR + 1,) * 2, np.uint8)
    beside = unknown & (cv2.dilate(agrees.astype(np.uint8), around) > 0)
    if (unknown & ~beside).sum() > (1.0 - LEAST_MEASURED) * (unknown.sum() + measured.sum()):
        return None
    return np.asarray(unknown if agrees.sum() >= FREE * measured.sum() else beside)


def _closed(points: Array, gap: int) -> Array:
    """A surface of depths where single points were: gaps are closed, and the border stays where it was."""
    around = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * gap + 1, 2 * gap + 1))
    padded = cv2.copyMakeBorder(np.isfinite(points).astype(np.uint8), *(gap,) * 4, cv2.BORDER_REPLICATE)
    filled = cv2.morphologyEx(padded, cv2.MORPH_CLOSE, around)[gap:-gap, gap:-gap] > 0
    return np.where(filled, cv2.erode(points, around), np.inf)


def _without_specks(mask: Array) -> Array:
    count, pieces, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    sizes = stats[1:, cv2.CC_STAT_AREA]
    keep = np.concatenate([[False], sizes >= LEAST_PIECE * sizes.max(initial=0)])
    return np.asarray(keep[pieces]) if count > 1 else mask
