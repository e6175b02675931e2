# SPDX-License-Identifier: Apache-2.0
"""A camera, what it takes, and what is detected in it."""

from __future__ import annotations

import math

import numpy as np

from objreg_ros import limits
from objreg_ros.data.checked import (
    Array,
    data_type,
    hold_array,
    require,
)


@data_type
class Intrinsics:
    """A pinhole camera without distortion: pixel ``u = fx x/z + cx``, pixel centres on integers."""

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int

    def __post_init__(self) -> None:
        numbers = (self.fx, self.fy, self.cx, self.cy)
        require(self, all(np.isfinite(numbers)), "finite fx fy cx cy", numbers)
        focal, centre = numbers[:2], numbers[2:]
        least, most = limits.LEAST_FOCAL_LENGTH, limits.MOST_FOCAL_LENGTH
        require(self, min(focal) >= least and max(focal) <= most, f"focal lengths of {least} to {most:.0f} px", focal)
        require(self, max(map(abs, centre)) <= most, f"a principal point within {most:.0f} px", centre)
        size = self.width, self.height
        require(self, min(size) > 0, "a size above 0 px", size)
        require(self, self.width * self.height <= limits.MOST_PIXELS, f"at most {limits.MOST_PIXELS} pixels", size)

    def scaled(self, step: int, first: tuple[int, int] | None = None) -> Intrinsics:
        """The camera that sees every ``step``-th pixel of each row and column.

        It starts at pixel ``first``, column and row, or at ``step // 2``.
        """
        left, top = first or (step // 2, step // 2)
        return Intrinsics(
            fx=self.fx / step,
            fy=self.fy / step,
            cx=(self.cx - left) / step,
            cy=(self.cy - top) / step,
            width=len(range(left, self.width, step)),
            height=len(range(top, self.height, step)),
        )

    def step_within(self, most_pixels: int) -> int:
        """The least step with which `scaled` leaves no more pixels than that."""
        step = 1
        while math.prod(max(1, len(range(step // 2, size, step))) for size in (self.width, self.height)) > most_pixels:
            step += 1
        return step


@data_type
class ColourImage:
    """``rgb (H, W, 3) uint8`` as a camera saw it at ``stamp_ns``."""

    rgb: Array
    stamp_ns: int
    frame_id: str = "camera"

    def __post_init__(self) -> None:
        hold_array(self, "rgb", np.uint8, (None, None, 3), {})


def _span(low: float, high: float, size: int) -> slice:
    first, end = (min(max(edge, 0), size) for edge in (math.floor(low), math.ceil(high)))
    return slice(first, max(first, end))


@data_type
class Detections:
    """What the detector saw in one image: N boxes, best first, with the score and the label of each.

    ``xyxy (N, 4) float32`` pixels of the full image, half open (x_max and y_max are outside); ``score (N,) float32``
    in 0..1; ``label`` N names; ``image_hw`` the image's height and width. An image with no object gives N = 0.
    ``ids`` are what the detector, or a tracker in it, calls each of them; empty where it gives none. ``instances (H, W)
    uint16`` shows the same field of view in any size: k + 1 where the k-th object is, 0 where none; None for no masks.
    """

    xyxy: Array
    score: Array
    label: tuple[str, ...]
    image_hw: tuple[int, int]
    stamp_ns: int
    frame_id: str = "camera"
    ids: tuple[str, ...] = ()
    instances: Array | None = None

    def __post_init__(self) -> None:
        sizes = {"N": len(self.label)}
        require(self, len(self.ids) in (0, len(self)), f"no ids, or one for each of {len(self)} boxes", len(self.ids))
        hold_array(self, "xyxy", np.float32, ("N", 4), sizes)
        hold_array(self, "score", np.float32, ("N",), sizes)
        require(self, bool(np.isfinite(self.xyxy).all()), "finite boxes", self.xyxy)
        require(self, bool(((self.score >= 0) & (self.score <= 1)).all()), "scores in 0..1", self.score)
        require(self, min(self.image_hw) > 0, "an image size above 0 px", self.image_hw)
        require(self, len(self) <= limits.MOST_DETECTIONS, f"at most {limits.MOST_DETECTIONS} boxes", len(self))
        if self.instances is not None:
            hold_array(self, "instances", np.uint16, (None, None), {})
            require(self, min(self.instances.shape) > 0, "instances of a size above 0 px", self.instances.shape)

    def __len__(self) -> int:
        return len(self.label)

    def instances_at(self, hw: tuple[int, int]) -> Array | None:
        """``instances`` in a picture of another height and width, by the nearest pixel."""
        if self.instances is None or self.instances.shape == hw:
            return self.instances
        pairs = zip(self.instances.shape, hw, strict=True)
        rows, columns = ((2 * np.arange(size) + 1) * own // (2 * size) for own, size in pairs)
        return self.instances[np.ix_(rows, columns)]

    def touched(self, k: int) -> tuple[slice, slice]:
        """Rows and columns of the picture's pixels that the k-th box touches; empty where it lies outside."""
        (height, width), (x_min, y_min, x_max, y_max) = self.image_hw, self.xyxy[k].tolist()
        return _span(y_min, y_max, height), _span(x_min, x_max, width)


@data_type
class PointCloud:
    """Points as a sensor sent them, before they become a `DepthImage`.

    ``xyz (H, W, 3) float32`` m, NaN where nothing was measured; H = 1 for an unorganised cloud; ``rgb`` (H, W, 3) uint8
    or None.
    """

    xyz: Array
    rgb: Array | None
    stamp_ns: int
    frame_id: str = "camera"

    def __post_init__(self) -> None:
        sizes: dict[str, int] = {}
        hold_array(self, "xyz", np.float32, ("H", "W", 3), sizes)
        if self.rgb is not None:
            hold_array(self, "rgb", np.uint8, ("H", "W", 3), sizes)

    @property
    def organised(self) -> bool:
        """Whether rows and columns are those of an image."""
        return bool(self.xyz.shape[0] > 1)


@data_type
class DepthImage:
    """What the segmenter makes of every depth source.

    ``depth (H, W) float32`` metres along the optical axis, 0 to `limits.MOST_DEPTH`, 0 where there is none (never NaN);
    ``rgb (H, W, 3) uint8`` registered to it, or None; ``intrinsics`` of the same size; ``shown (H, W) bool`` to which
    pixels the sensor's picture reaches, where it was rectified and leaves some out, or None for all.
    """

    depth: Array
    rgb: Array | None
    intrinsics: Intrinsics
    stamp_ns: int
    frame_id: str = "camera"
    shown: Array | None = None

    def __post_init__(self) -> None:
        sizes = {"H": self.intrinsics.height, "W": self.intrinsics.width}
        if self.shown is not None:
            hold_array(self, "shown", np.bool_, ("H", "W"), sizes)
        hold_array(self, "depth", np.float32, ("H", "W"), sizes)
        if self.rgb is not None:
            hold_array(self, "rgb", np.uint8, ("H", "W", 3), sizes)
        least, most = float(self.depth.min()), float(self.depth.max())  # NaN is within no bounds
        in_reach = least >= 0.0 and most <= limits.MOST_DEPTH
        require(self, in_reach, f"depth of 0 to {limits.MOST_DEPTH:g} m", f"{least:g} to {most:g} m")
