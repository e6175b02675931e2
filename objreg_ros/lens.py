# SPDX-License-Identifier: Apache-2.0
"""A lens that bends rays, and how its pictures become those of a pinhole camera.

The models are those of ROS (REP-104, image_geometry) as OpenCV computes them: plumb_bob is Brown's radial and
tangential distortion (1966), rational_polynomial its extension by a denominator, equidistant the fisheye model of
Kannala and Brandt (2006). Pixel centres are on integers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import DepthImage, Detections, Intrinsics

# model: how many coefficients it may have
MODELS = {
    "plumb_bob": (4, 5, 8, 12, 14),  # beyond 5 it is a rational_polynomial, which many drivers do not call so
    "rational_polynomial": (8, 12, 14),  # 12 and 14: with a thin prism and a tilted sensor, as OAK-D's driver says
    "equidistant": (4,),
}
UPRIGHT = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)  # no rotation between raw and rectified rays
MOST_SIDE = 32766  # px: OpenCV's remap counts in 16 bits
LEAST_SHOWN = 0.25  # of the rectified picture; a wide lens that is shown whole still fills more
OUTLINE = 5  # points of each side of a box: a bent side bulges between its corners
STEPS, CLOSE_PX, PROBE = 30, 0.01, 1e-5  # of Newton's method; what it must reach; its step in a derivative
FOLD_PIXELS = 1_000_000  # checked for folds at most; larger pictures are subsampled
GRID = 65  # points of a row and of a column at which the displacement of pixels is measured
ON_THE_WAY = (0.25, 0.5, 0.75, 1.0)  # from the axis to a ray, where the picture must not be folded yet
NOWHERE = -1e4  # px: where a pixel is looked for that the raw picture does not show


@dataclass(frozen=True, eq=False)
class Lens:
    """A distorted camera ``raw`` and the pinhole ``camera`` of its rectified picture, both of one size.

    ``model`` is one of `MODELS`, ``D`` its coefficients in OpenCV's order, ``R`` (9 numbers, row by row) turns the rays
    of the raw camera into those of the rectified one. Depth along the optical axis stays only where R is none.
    ValueError for an unknown model, another number of coefficients, numbers that are not finite, and a lens that folds
    its picture over itself so near the middle that next to nothing of it can be shown.
    """

    model: str
    D: tuple[float, ...]
    raw: Intrinsics
    camera: Intrinsics
    R: tuple[float, ...] = UPRIGHT

    def __post_init__(self) -> None:
        require_model(self.model, self.D)
        size, other = (self.raw.width, self.raw.height), (self.camera.width, self.camera.height)
        if size != other or max(size) > MOST_SIDE:
            raise ValueError(
                f"lens: expected two cameras of one size of at most {MOST_SIDE} px, got {size} and {other}"
            )
        if not np.isfinite(self.R).all() or abs(np.linalg.det(self._turn) - 1) > 1e-3:
            raise ValueError(f"lens: expected a rotation R, got {list(self.R)}")
        share = float(self.shown.mean())
        if share < LEAST_SHOWN:
            raise ValueError(
                f"lens: expected {self.model} coefficients whose rectified picture shows at least "
                f"{100 * LEAST_SHOWN:.0f} % of its pixels, got {100 * share:.0f} % with {list(self.D)}: the picture "
                "folds over itself or leaves its frame; calibrate the camera anew"
            )

    # Pictures

    def rectify(self, image: DepthImage, depth: bool = True, colour: bool = True) -> DepthImage:
        """The rectified picture; depth or colour that is rectified already is left as it is."""
        rgb = image.rgb if image.rgb is None or not colour else self.rectify_colour(image.rgb)
        metres = self.rectify_depth(image.depth) if depth else image.depth
        shown = self.shown if depth else image.shown
        return replace(image, depth=metres, rgb=rgb, intrinsics=self.camera, shown=shown)

    def rectify_depth(self, depth: Array) -> Array:
        """Depth (H, W) of the nearest raw pixel, 0 where no raw pixel shows the place. It is along the axis: it stays.

        ValueError, as for every picture here, if it is of another size.
        """
        return self._remap(depth, cv2.INTER_NEAREST, cv2.BORDER_CONSTANT)

    def rectify_colour(self, rgb: Array) -> Array:
        """Colour (H, W, 3), linear between raw pixels; the nearest of the frame where none shows the place.

        So no edge is drawn in grey where the raw picture ends.
        """
        return self._remap(rgb, cv2.INTER_LINEAR, cv2.BORDER_REPLICATE)

    def rectify_mask(self, mask: Array) -> Array:
        """A mask (H, W) bool of the nearest raw pixel, False where no raw pixel shows the place."""
        return np.asarray(self.rectify_depth(mask.astype(np.uint8)) > 0)

    def _remap(self, picture: Array, interpolation: int, border: int) -> Array:
        if picture.shape[:2] != (self.raw.height, self.raw.width):
            got = f"{picture.shape[1]} x {picture.shape[0]}"
            raise ValueError(f"lens: expected a picture of {self.raw.width} x {self.raw.height} px, got {got}")
        return np.asarray(cv2.remap(np.ascontiguousarray(picture), *self._maps, interpolation, borderMode=border))

    # Boxes

    def rectify_detections(self, detections: Detections) -> Detections:
        """Detections of a raw picture of any size that shows what this camera sees, as those of the rectified one."""
        height, width = detections.image_hw
        scale = np.array([self.raw.width / width, self.raw.height / height] * 2)
        xyxy = self.rectify_xyxy(detections.xyxy * scale) / scale
        numbers = detections.instances_at((self.raw.height, self.raw.width))
        instances = None if numbers is None else self.rectify_depth(numbers)
        return replace(detections, xyxy=xyxy.astype(np.float32), instances=instances)

    def rectify_xyxy(self, xyxy: Array) -> Array:
        """The boxes (N, 4), half open, around the rectified outlines of boxes of the raw picture.

        What of an outline has no place in front of the rectified camera is left out; zeros, an empty box, where that is
        all of it.
        """
        if len(xyxy) == 0:
            return np.zeros((0, 4))
        limits = np.array([self.raw.width, self.raw.height] * 2)
        inside = np.clip(np.asarray(xyxy, np.float64), 0, limits)
        uv, known = self.rectify_uv(_outlines(inside).reshape(-1, 2) - 0.5)
        uv, known = uv.reshape(len(xyxy), -1, 2) + 0.5, known.reshape(len(xyxy), -1)
        low = np.where(known[..., None], uv, np.inf).min(axis=1)
        high = np.where(known[..., None], uv, -np.inf).max(axis=1)
        any_known = np.logical_or.reduce(known, axis=1)
        boxes = np.where(np.asarray(any_known)[:, None], np.hstack([low, high]), 0.0)
        return np.clip(boxes, 0, limits)

    def rectify_uv(self, uv: Array) -> tuple[Array, Array]:
        """The rectified positions of raw pixels (N, 2), and whether they are known (N,): Newton's method."""
        wanted = np.asarray(uv, np.float64)
        K = _matrix(self.raw)
        ray = np.column_stack([(wanted - K[:2, 2]) / K[[0, 1], [0, 1]], np.ones(len(wanted))]) @ self._turn.T
        at = ray[:, :2] / np.where(np.abs(ray[:, 2:]) < 1e-9, 1e-9, ray[:, 2:])
        with np.errstate(all="ignore"):
            for _ in range(STEPS):
                off = self._seen_at(at) - wanted
                if np.abs(off).max(initial=0.0) < CLOSE_PX / 10:
                    break
                at = at - _solved(self._derivative(at), off)
            close = np.abs(self._seen_at(at) - wanted).max(axis=1) < CLOSE_PX
            way = [_determinant(self._derivative(share * at)) > 0 for share in ON_THE_WAY]
            unfolded = np.logical_and.reduce(way)  # beyond a fold there are false solutions, beyond two as well
        camera = _matrix(self.camera)
        rectified = at * camera[[0, 1], [0, 1]] + camera[:2, 2]
        known = np.asarray(close & unfolded & np.isfinite(rectified).all(axis=1))
        return np.where(known[:, None], rectified, 0.0), known

    def _derivative(self, at: Array) -> Array:
        """(N, 2, 2): how the raw pixel goes with the rectified ray."""
        columns = [(self._seen_at(at + step) - self._seen_at(at - step)) / (2 * PROBE) for step in PROBE * np.eye(2)]
        return np.stack(columns, axis=-1)

    def _seen_at(self, at: Array) -> Array:
        """The raw pixels (N, 2) that show the rectified rays ``x/z, y/z`` (N, 2)."""
        ray = np.column_stack([at, np.ones(len(at))]) @ self._turn
        K, D = _matrix(self.raw), self._coefficients
        if self.model == "equidistant":
            flat = (ray[:, :2] / ray[:, 2:]).reshape(-1, 1, 2)
            return cv2.fisheye.distortPoints(flat, K, D).reshape(-1, 2)
        pixels, _ = cv2.projectPoints(ray.reshape(-1, 1, 3), np.zeros(3), np.zeros(3), K, D)
        return pixels.reshape(-1, 2)

    # What it does to the picture

    def shift_px(self) -> tuple[float, float]:
        """How far the lens moves a pixel of the rectified picture of the raw camera's matrix: median, and most."""
        return self._shift_px

    @cached_property
    def _shift_px(self) -> tuple[float, float]:
        K, size = _matrix(self.raw), np.array([self.raw.width, self.raw.height])
        middles = (np.arange(GRID) + 0.5) / GRID  # of as many parts of the picture, for the median
        frame = _outlines(np.array([[0.5, 0.5, *(size - 0.5)]]))[0]  # where most is, as a rule
        straight = np.vstack([np.stack(np.meshgrid(middles, middles), -1).reshape(-1, 2) * size, frame]) - 0.5
        lens = replace(self, camera=self.raw, R=UPRIGHT) if self.R != UPRIGHT else self
        off = np.linalg.norm(lens._seen_at((straight - K[:2, 2]) / K[[0, 1], [0, 1]]) - straight, axis=1)
        return float(np.median(off[: GRID**2])), float(off.max())

    def __str__(self) -> str:
        median, most = self.shift_px()
        return f"{self.model}, moves a pixel by {median:.1f} px (median), {most:.1f} at most"

    @cached_property
    def shown(self) -> Array:
        """(H, W) bool: which pixels of the rectified picture a raw pixel shows."""
        u, v = self._maps
        inside = (u > -0.5) & (v > -0.5) & (u < self.raw.width - 0.5) & (v < self.raw.height - 0.5)
        return np.asarray(inside)

    @cached_property
    def _coefficients(self) -> Array:
        return np.array(_without_filling(self.model, self.D), np.float64)

    @cached_property
    def _turn(self) -> Array:
        return np.array(self.R, np.float64).reshape(3, 3)

    @cached_property
    def _maps(self) -> tuple[Array, Array]:
        """The raw column and row (H, W) float32 that every rectified pixel shows; `NOWHERE` behind a fold."""
        K, D, P = _matrix(self.raw), self._coefficients, _matrix(self.camera)
        make = cv2.fisheye.initUndistortRectifyMap if self.model == "equidistant" else cv2.initUndistortRectifyMap
        u, v = make(K, D, self._turn, P, (self.raw.width, self.raw.height), cv2.CV_32FC1)
        step = math.ceil(math.sqrt(u.size / FOLD_PIXELS))
        kept = _unfolded(u[::step, ::step], v[::step, ::step], self.camera.cx / step, self.camera.cy / step)
        if step > 1:
            kept = cv2.resize(kept.astype(np.uint8), u.shape[::-1], interpolation=cv2.INTER_NEAREST) > 0
        u[~kept] = v[~kept] = NOWHERE
        return u, v


def require_model(model: str, D: tuple[float, ...]) -> None:
    """ValueError unless ``D`` are finite coefficients of a known model, as many as it has but for zeros behind them."""
    if model not in MODELS:
        raise ValueError(f"lens: expected a distortion model of {', '.join(MODELS)}, got {model[:40]!r}")
    if len(_without_filling(model, D)) not in MODELS[model]:
        *fewer, most = map(str, MODELS[model])
        wanted = f"{', '.join(fewer)} or {most}" if fewer else most
        raise ValueError(f"lens: expected {wanted} coefficients of {model}, got {len(D)}")
    if not np.isfinite(D).all():
        raise ValueError(f"lens: expected finite coefficients of {model}, got {list(D)}")


def _without_filling(model: str, D: tuple[float, ...]) -> tuple[float, ...]:
    """The coefficients without the zeros that fill an array behind as many as the model has."""
    if len(D) in MODELS[model]:
        return D
    return next((D[:count] for count in MODELS[model] if len(D) > count and not any(D[count:])), D)


def _matrix(camera: Intrinsics) -> Array:
    return np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]], np.float64)


def _outlines(xyxy: Array) -> Array:
    """(N, 4 * OUTLINE, 2): points along the four sides of boxes (N, 4)."""
    along = np.linspace(0, 1, OUTLINE)
    ones, zeros = np.ones(OUTLINE), np.zeros(OUTLINE)
    x = np.concatenate([along, along, zeros, ones])
    y = np.concatenate([zeros, ones, along, along])
    corner, size = xyxy[:, None, :2], (xyxy[:, 2:] - xyxy[:, :2])[:, None]
    return corner + size * np.column_stack([x, y])


def _solved(J: Array, off: Array) -> Array:
    """The solutions (N, 2) of the small systems ``J (N, 2, 2) x = off``; not finite where there is none."""
    x = J[:, 1, 1] * off[:, 0] - J[:, 0, 1] * off[:, 1]
    y = J[:, 0, 0] * off[:, 1] - J[:, 1, 0] * off[:, 0]
    return np.column_stack([x, y]) / _determinant(J)[:, None]


def _determinant(J: Array) -> Array:
    return np.asarray(J[:, 0, 0] * J[:, 1, 1] - J[:, 0, 1] * J[:, 1, 0])


def _unfolded(u: Array, v: Array, cx: float, cy: float) -> Array:
    """(H, W) bool: what can be reached from the principal point without the map turning over itself."""
    if min(u.shape) < 2:
        return np.isfinite(u) & np.isfinite(v)
    with np.errstate(all="ignore"):
        (u_down, u_right), (v_down, v_right) = np.gradient(u), np.gradient(v)
        keeps = (u_right * v_down - u_down * v_right > 0) & np.isfinite(u) & np.isfinite(v)
    _, parts = cv2.connectedComponents(keeps.astype(np.uint8), connectivity=4)
    row, column = (int(np.clip(round(c), 0, size - 1)) for c, size in zip((cy, cx), u.shape, strict=True))
    return keeps & (parts == parts[row, column])
