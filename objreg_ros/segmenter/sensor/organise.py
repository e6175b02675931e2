# SPDX-License-Identifier: Apache-2.0
"""Every cloud becomes a `DepthImage`: an organised one by its z, an unorganised one by projection."""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import DepthImage, Intrinsics, PointCloud

FAR = 65.0  # metres; 65535 mm and 65535 m both mean "no depth"
MIN_FIT = 30  # points that a fit of the intrinsics needs
STEPS = (1, 2, 3, 4, 6, 8)  # pixels in each row and column that become one for a thinned cloud
SAMPLE, NEAREST = 20000, 0.3  # points, and which share of them, by which a cloud fills an image or not
IN_IMAGE = 0.4  # share of the points in front that a camera sees; half where depth sees wider than colour
FILLED = 0.75  # share of these that have a point right of them, and below
BEGUN = 0.9  # share of the points in every step-th column, and row, of a cloud that was thinned to these
FIT_ERROR_PX = 1.5  # the median distance that a pixel may have from where the fitted camera sees its point

TURN = "publish /tf_static between its frame and that of the picture, or the cloud in the optical frame of its camera"


class CloudError(ValueError):
    """A cloud that is no picture: the ``fact`` is what was expected and got, and ``advice`` is for a node's user."""

    def __init__(self, fact: str, advice: str = "") -> None:
        super().__init__(f"{fact}; {advice}" if advice else fact)
        self.fact = fact


def organise(cloud: PointCloud, intrinsics: Intrinsics | None = None) -> DepthImage:
    """The depth image of a cloud.

    An organised cloud (H > 1) gives its z; with no ``intrinsics`` (or intrinsics of another size, or that do not see
    the points in their pixels) the camera is fitted to the cloud's own points. An unorganised cloud (H = 1) is
    projected with ``intrinsics``, the nearest point of a pixel wins; a thinned one gives the smaller image
    that its points fill. NaN, infinity, 0 and 65535 are "no depth".
    Raises `CloudError`, a ValueError, when the camera is not known and cannot be fitted, when nothing was measured, and
    when the points do not lie in front of the camera or in their pixels (the cloud is not in an optical frame).
    """
    xyz = cloud.xyz
    measured = _measured(xyz)
    _require_in_front(xyz[..., 2], measured)
    in_front = measured & (xyz[..., 2] > 0)
    if cloud.organised:
        height, width = xyz.shape[:2]
        if intrinsics is None or (intrinsics.height, intrinsics.width) != (height, width):
            intrinsics = fit_intrinsics(xyz, in_front)
        elif not _error_px(xyz, in_front, intrinsics) <= FIT_ERROR_PX:
            intrinsics = _fitted_instead(xyz, in_front, intrinsics)
        depth, rgb = np.where(in_front, xyz[..., 2], np.float32(0)), cloud.rgb
    else:
        if intrinsics is None:
            raise CloudError(
                f"an unorganised cloud of {xyz.shape[1]} points: expected a camera to project it with, got none",
                "publish camera_info beside the cloud, or an organised cloud",
            )
        colours = None if cloud.rgb is None else cloud.rgb[0][in_front[0]]
        depth, rgb, intrinsics = _project(xyz[0][in_front[0]], colours, intrinsics)
    return DepthImage(depth=depth, rgb=rgb, intrinsics=intrinsics, stamp_ns=cloud.stamp_ns, frame_id=cloud.frame_id)


def _measured(xyz: Array) -> Array:
    z = xyz[..., 2]
    with np.errstate(invalid="ignore"):
        return np.isfinite(xyz).all(axis=-1) & (np.abs(z) < FAR) & (z != 0)


def _require_in_front(z: Array, measured: Array) -> None:
    count = int(np.count_nonzero(measured))
    in_front = int(np.count_nonzero(z[measured] > 0))
    if count == 0:
        raise CloudError(f"expected measured points, got {z.size} points that are all NaN, 0 or 65535")
    if in_front < count / 2:
        raise CloudError(
            "expected a cloud in the optical frame (x right, y down, z forward) with points in front of the camera, "
            f"got {count - in_front} of {count} points with negative z",
            TURN,
        )


def fit_intrinsics(xyz: Array, valid: Array) -> Intrinsics:
    """The pinhole camera that sees each point of an organised ``xyz (H, W, 3)`` in its own pixel.

    Least squares of ``u = fx x/z + cx`` over the ``valid (H, W)`` points, and the same for rows. ValueError if there
    are fewer than 30 points or the pixels do not fit to a median of 1.5 px (the cloud is not one pinhole image).
    """
    rows, cols = np.nonzero(valid)
    if len(rows) < MIN_FIT:
        raise CloudError(
            f"expected at least {MIN_FIT} measured points to fit the camera of an organised cloud, got {len(rows)}",
            "publish camera_info beside the cloud",
        )
    step = max(1, len(rows) // 20000)
    rows, cols = rows[::step], cols[::step]
    x, y, z = xyz[rows, cols].T.astype(np.float64)
    fx, cx, error_u = _fit_line(x / z, cols)
    fy, cy, error_v = _fit_line(y / z, rows)
    error = max(error_u, error_v)
    if not error <= FIT_ERROR_PX or fx <= 0 or fy <= 0:
        raise CloudError(
            f"expected pixels that fit a pinhole camera to {FIT_ERROR_PX} px, got {error:.3g} px with "
            f"fx {fx:.4g}, fy {fy:.4g}: its rows and columns are no picture along z, as in a frame with x forward",
            f"{TURN}, or publish camera_info and the cloud as unorganised (height 1)",
        )
    height, width = valid.shape
    return Intrinsics(fx=fx, fy=fy, cx=cx, cy=cy, width=width, height=height)


def _error_px(xyz: Array, valid: Array, camera: Intrinsics) -> float:
    """The median distance of pixels from where a camera sees their points; 0 where there are too few of them."""
    step = max(1, int(np.sqrt(valid.size / SAMPLE)))
    rows, cols = np.nonzero(valid[::step, ::step])
    if len(rows) < MIN_FIT:
        return 0.0
    x, y, z = xyz[::step, ::step][rows, cols].T.astype(np.float64)
    beside = camera.fx * x / z + camera.cx - cols * step
    below = camera.fy * y / z + camera.cy - rows * step
    return float(np.median(np.maximum(np.abs(beside), np.abs(below))))


def _fitted_instead(xyz: Array, valid: Array, camera: Intrinsics) -> Intrinsics:
    """The camera of the cloud itself where the one that came beside it is another's."""
    try:
        return fit_intrinsics(xyz, valid)
    except ValueError as error:
        off = _error_px(xyz, valid, camera)
        raise CloudError(
            "expected an organised cloud in the optical frame (x right, y down, z forward) of its camera, got one "
            f"whose points lie {off:.3g} px beside their pixels",
            TURN,
        ) from error


def _fit_line(ratio: Array, pixel: Array) -> tuple[float, float, float]:
    """Slope, offset and median error of ``pixel = slope · ratio + offset``."""
    if np.ptp(ratio) < 1e-6:
        return 0.0, 0.0, float("inf")
    slope, offset = np.polyfit(ratio, pixel.astype(np.float64), 1)
    return float(slope), float(offset), float(np.median(np.abs(slope * ratio + offset - pixel)))


def _project(points: Array, rgb: Array | None, camera: Intrinsics) -> tuple[Array, Array | None, Intrinsics]:
    """Depth (h, w) and colour (h, w, 3) of points (N, 3) in front of the camera, and the camera that sees them so.

    That is the one with the most pixels of ``camera`` and its reductions that the points fill, ``camera`` if they fill
    none; of one pixel the nearest point wins.
    """
    _require_in_image(points, camera)
    for grid in (*(camera.scaled(step, _first(points, camera, step)) for step in STEPS), camera):
        inside, index = _pixels(points, grid)
        z = points[inside, 2]
        if _is_filled(index, z, grid):
            break
    far_first = np.argsort(-z, kind="stable")
    depth = np.zeros(grid.height * grid.width, np.float32)
    depth[index[far_first]] = z[far_first]
    if rgb is None:
        return depth.reshape(grid.height, grid.width), None, grid
    colour = np.zeros((grid.height * grid.width, 3), np.uint8)
    colour[index[far_first]] = rgb[inside][far_first]
    return depth.reshape(grid.height, grid.width), colour.reshape(grid.height, grid.width, 3), grid


def _require_in_image(points: Array, camera: Intrinsics) -> None:
    seen = len(_pixels(points, camera)[1])
    if seen < max(1.0, IN_IMAGE * len(points)):
        raise CloudError(
            f"expected points within the {camera.width}x{camera.height} image, got {seen} of {len(points)} there",
            f"is it in the optical frame of this camera (x right, y down, z forward)? If not, {TURN}",
        )


def _first(points: Array, camera: Intrinsics, step: int) -> tuple[int, int] | None:
    """The column and row with which a thinning to every ``step``-th pixel began; None if it was none of that kind."""
    _, index = _pixels(points[:: max(1, len(points) // SAMPLE)], camera)
    counts = [np.bincount(pixel % step, minlength=step) for pixel in (index % camera.width, index // camera.width)]
    if any(count.max() < BEGUN * len(index) for count in counts):
        return None
    return int(counts[0].argmax()), int(counts[1].argmax())


def _pixels(points: Array, camera: Intrinsics) -> tuple[Array, Array]:
    """Which points (N,) bool lie in the image, and the pixels (M,) of those, counted row by row."""
    x, y, z = points.T
    u = np.rint(camera.fx * x / z + camera.cx)
    v = np.rint(camera.fy * y / z + camera.cy)
    inside = (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    return inside, (v[inside] * camera.width + u[inside]).astype(np.int64)


def _is_filled(index: Array, z: Array, camera: Intrinsics) -> bool:
    """Whether enough of the nearest points, where a cloud thinned by volume is thinnest, have points beside them."""
    if len(index) == 0:
        return False
    seen = np.zeros((camera.height + 1) * camera.width + 1, np.bool_)
    seen[index] = True
    some = slice(None, None, max(1, len(index) // SAMPLE))
    near = index[some][z[some] <= np.quantile(z[some], NEAREST)]
    return bool(min(seen[near + 1].mean(), seen[near + camera.width].mean()) >= FILLED)
