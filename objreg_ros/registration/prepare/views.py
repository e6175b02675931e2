# SPDX-License-Identifier: Apache-2.0
"""What one view says of points that another view measured: seen there, floating in free space, or hidden.

A `Sight` is a `View` made ready for that question: the nearest and the farthest depth around each pixel (colour and
depth are a few pixels apart on real cameras, and edges are ragged), the grey and its bands, and the points to ask with.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import View
from objreg_ros.data.images import Intrinsics
from objreg_ros.registration.kernels.projection import project
from objreg_ros.registration.keyframe import KeyObject
from objreg_ros.sensor import depth_noise

DETAIL_SIGMA_PX = 3.0  # blur that the high pass of grey takes away
EDGE = 0.06  # of the depth: a larger range around a pixel is a depth jump
SHADELESS = 1e6  # the shade of a point at a depth jump: not to be compared
FINEST = 0.5  # px: a blur that takes pixel noise away
BLURS = (2.5, 1.0)  # of the bands, the coarse one first
SMOOTH = 0.7  # px: the blur of grey that is laid into another view
LEAST_CONTRAST = 2.0  # grey levels; less is noise, not texture
WINDOW = 9  # px: what is in front of everything so far around is in front, however ragged edges are
RIM = np.ones((5, 5), np.uint8)  # px: a cloud leaves out the ragged rim of its object
NEAR = 0.02  # m before and behind an object's points: what lies there in its pixels is it
NEAREST = 0.3  # m; nearer depth is noise on every structured-light camera


class Band(NamedTuple):
    """Grey, or a part of it: ``detail (h, w) float32`` of the image and ``shades (P,) float32`` of its points."""

    detail: Array
    shades: Array


class Print(NamedTuple):
    """Grey to be laid into another view: ``detail (h, w) float32`` of the image, smoothed within surfaces and SHADELESS
    elsewhere; the ``points (Q, 3) float32`` m on surfaces, row by row, and their ``shades (Q,) float32``."""

    detail: Array
    points: Array
    shades: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sight:
    """A view made ready. ``near``, ``far (h, w) float32`` m, 0 where nothing was measured.

    ``bands`` are its grey without the slow part, coarse first; ``grey`` is all of it.

    ``front (h, w) float32`` m is the nearest depth in a wide window around each pixel, 0 where nothing was measured.

    ``points (P, 3) float32`` m are its measured pixels in a fixed shuffled order, so that the first n of them are a
    fair sample; a pixel at a depth jump has the shade SHADELESS. ``noise`` is that of depth, in a Kinect's.
    """

    near: Array
    far: Array
    front: Array
    points: Array
    bands: tuple[Band, ...]
    grey: Print
    textured: bool
    intrinsics: Intrinsics
    noise: float = 1.0

    @property
    def detail(self) -> Array:
        """The finest band of the image."""
        return self.bands[-1].detail

    @property
    def shades(self) -> Array:
        """The finest band of the points."""
        return self.bands[-1].shades

    @property
    def camera(self) -> tuple[float, float, float, float]:
        """fx, fy, cx, cy."""
        return self.intrinsics.fx, self.intrinsics.fy, self.intrinsics.cx, self.intrinsics.cy


def prepare_sight(view: View, sight_range: float, detail_sigma: float, seed: int = 0) -> Sight:
    """Make a view ready: depth beyond ``sight_range`` m is dropped; ``detail_sigma`` px is of the high pass."""
    depth = np.nan_to_num(view.xyz[..., 2], nan=0.0)
    depth = np.where((depth > NEAREST) & (depth < sight_range), depth, 0.0).astype(np.float32)
    near, far = depth_bounds(depth)
    jump = far - near > EDGE * np.maximum(far, 1.0)
    chosen = np.random.default_rng(seed).permutation(np.flatnonzero(depth > 0))
    return Sight(
        near=near,
        far=far,
        front=nearest_depth(depth, WINDOW),
        points=np.ascontiguousarray(view.xyz.reshape(-1, 3)[chosen]),
        bands=tuple(_band(view.grey, blur * FINEST, blur * detail_sigma, jump, chosen) for blur in BLURS),
        grey=_print(view, (depth > 0) & ~jump),
        textured=view.grey is not None,
        intrinsics=view.intrinsics,
        noise=depth_noise(depth),
    )


def pixels_of(points: Array, sight: Sight) -> tuple[Array, Array]:
    """The rows and the columns (P,) of the pixels that ``points (P, 3)`` before the camera are in, or would be."""
    u, v, _ = project(points, np.eye(4), sight.camera)
    return np.rint(v).astype(np.intp), np.rint(u).astype(np.intp)


def halved(view: View) -> View:
    """The view at half its size, its grey smoothed before."""
    odd = slice(1, None, 2)
    grey = None if view.grey is None else cv2.GaussianBlur(view.grey, (0, 0), 1.0)[odd, odd]
    return View(xyz=view.xyz[odd, odd], grey=grey, intrinsics=view.intrinsics.scaled(2))


def depth_bounds(depth: Array) -> tuple[Array, Array]:
    """The nearest and the farthest measured depth in the 3 x 3 pixels around each; 0 where none was measured."""
    return nearest_depth(depth, 3), cv2.dilate(depth, np.ones((3, 3), np.uint8))


def nearest_depth(depth: Array, window: int) -> Array:
    """The nearest measured depth in a square of ``window`` pixels around each; 0 where none was measured."""
    near = cv2.erode(np.where(depth > 0, depth, np.float32(1e3)), np.ones((window, window), np.uint8))
    return np.where(near < 1e3, near, 0.0).astype(np.float32)


def _band(grey: Array | None, fine: float, slow: float, jump: Array, chosen: Array) -> Band:
    detail = np.zeros(jump.shape, np.float32) if grey is None else band_pass(grey, fine, slow)
    shades = np.where(jump, np.float32(SHADELESS), detail)
    return Band(detail, np.ascontiguousarray(shades.ravel()[chosen]))


def _print(view: View, surface: Array) -> Print:
    """The grey of a view, blurred within the ``surface (h, w) bool``."""
    if view.grey is None:
        nothing = np.zeros((0, 3), np.float32)
        return Print(np.full(surface.shape, SHADELESS, np.float32), nothing, nothing[:, 0])
    weighed = np.dstack([view.grey * surface, surface]).astype(np.float32)
    total, weight = np.moveaxis(cv2.GaussianBlur(weighed, (0, 0), SMOOTH), -1, 0)
    detail = np.where(surface, total / np.maximum(weight, np.float32(1e-6)), np.float32(SHADELESS))
    return Print(detail, view.xyz[surface], view.grey[surface].astype(np.float32))


def band_pass(grey: Array, fine: float, slow: float) -> Array:
    """Grey between two blurs in pixels, in its standard deviations: lighting, exposure and contrast drop out."""
    image = cv2.GaussianBlur(grey.astype(np.float32), (0, 0), fine)
    detail = image - cv2.GaussianBlur(image, (0, 0), slow)
    return np.asarray(detail / max(LEAST_CONTRAST, float(detail.std())), np.float32)


def own_pixels(item: KeyObject, sight: Sight) -> Array:
    """Where a view shows an object (h, w) bool."""
    xyz, (height, width) = item.cloud.xyz, sight.near.shape
    rows, columns = pixels_of(xyz[xyz[:, 2] > NEAREST], sight)
    inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    own = np.zeros((height, width), np.uint8)
    own[rows[inside], columns[inside]] = 1
    low, high = xyz[:, 2].min() - NEAR, xyz[:, 2].max() + NEAR
    return np.asarray((cv2.dilate(own, RIM) > 0) & (sight.far >= low) & (sight.near <= high))
