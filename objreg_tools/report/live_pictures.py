# SPDX-License-Identifier: Apache-2.0
"""Two pictures of a live run: what the graph detected in one frame, and the trajectory with its closures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import ObjectCloud
from objreg_ros.data.images import Detections, Intrinsics
from objreg_ros.whole_file import whole_file, write_whole
from objreg_tools.truth import FALSE, Truth, within

GOLDEN_ANGLE = 137.508  # degrees of hue between one object and the next: neighbours always differ
FONT, FONT_SIZE = cv2.FONT_HERSHEY_SIMPLEX, 0.42
RIGHT, WRONG, TRAJECTORY = "#1a8a3c", "#d03b3b", "#8b8a83"


def draw_sight(
    file: Path, rgb: Array, camera: Intrinsics, detections: Detections, objects: Sequence[ObjectCloud]
) -> None:
    """Write the picture of one frame as `sight` draws it."""
    write_picture(file, sight(rgb, camera, detections, objects))


def sight(rgb: Array, camera: Intrinsics | None, detections: Detections, objects: Sequence[ObjectCloud]) -> Array:
    """(H, W, 3) uint8 RGB of one frame: boxes with names, and the points of each object in its colour.

    Without a camera there are no points.
    """
    picture = np.ascontiguousarray(rgb[..., ::-1])
    if camera is not None:
        for item in objects:
            _draw_points(picture, item.xyz, camera, colour_of(item.instance))
    for box, score, label in zip(detections.xyxy, detections.score, detections.label, strict=True):
        _draw_box(picture, box, f"{label} {score:.2f}")
    return picture[..., ::-1]


def write_picture(file: Path, rgb: Array) -> None:
    """Write (H, W, 3) uint8 RGB in the format of the file's name; OSError if it cannot be."""
    try:
        written, encoded = cv2.imencode(file.suffix, np.ascontiguousarray(rgb[..., ::-1]))
    except cv2.error as error:  # no format of this name
        raise OSError(f"{file}: expected a name like picture.png, got one of an unknown format; rename it") from error
    if not written:
        raise OSError(f"{file}: expected a picture of at most what its format takes, got {rgb.shape}; choose another")
    write_whole(file, encoded.tobytes())


def colour_of(instance: int) -> tuple[int, int, int]:
    """The colour of an object, BGR."""
    hsv = np.array([[[int(instance * GOLDEN_ANGLE % 360 / 2), 200, 255]]], np.uint8)
    b, g, r = (int(value) for value in cv2.cvtColor(hsv, cv2.COLOR_HSV2BGR)[0, 0])
    return b, g, r


def _draw_points(picture: Array, xyz: Array, camera: Intrinsics, colour: tuple[int, int, int]) -> None:
    """Half transparent, so that what is under the points stays visible."""
    x, y, z = xyz[xyz[:, 2] > 0].T
    u = np.rint(camera.fx * x / z + camera.cx).astype(int)
    v = np.rint(camera.fy * y / z + camera.cy).astype(int)
    inside = (u >= 0) & (u < picture.shape[1]) & (v >= 0) & (v < picture.shape[0])
    u, v = u[inside], v[inside]
    picture[v, u] = (0.4 * picture[v, u] + 0.6 * np.array(colour)).astype(np.uint8)


def _draw_box(picture: Array, xyxy: Array, name: str) -> None:
    x_min, y_min, x_max, y_max = (round(float(value)) for value in xyxy)
    cv2.rectangle(picture, (x_min, y_min), (x_max, y_max), (255, 255, 255), 1, cv2.LINE_AA)
    (width, height), base = cv2.getTextSize(name, FONT, FONT_SIZE, 1)
    left = max(0, min(x_min + 1, picture.shape[1] - width - 4))  # a name ends where the picture does
    bottom = max(y_min, 0) + height + base + 2
    cv2.rectangle(picture, (left, bottom - height - base - 1), (left + width + 3, bottom), (0, 0, 0), cv2.FILLED)
    cv2.putText(picture, name, (left + 2, bottom - base), FONT, FONT_SIZE, (255, 255, 255), 1, cv2.LINE_AA)


def draw_trajectory(file: Path, truth: Truth, closures: Sequence[LoopClosure]) -> None:
    """Write the camera's trajectory from above with its closures, the true ones green and the false ones red.

    The plane is that of the two directions in which the trajectory extends most. ValueError where the truth has no
    poses, ModuleNotFoundError where there is no matplotlib.
    """
    if not truth.poses:
        raise ValueError("expected a recording with ground truth to draw its path")
    try:
        from matplotlib.figure import Figure
    except ModuleNotFoundError as absent:
        lacking = "expected matplotlib to draw the trajectory, found none; pip install 'objreg_ros[report]' brings it"
        raise ModuleNotFoundError(lacking, name="matplotlib") from absent

    positions = np.array([T[:3, 3] for T in truth.poses])
    axes = np.linalg.svd(positions - positions.mean(axis=0), full_matrices=False)[2][:2]
    figure = Figure(figsize=(8, 6), layout="constrained")
    plot = figure.add_subplot(aspect="equal", xlabel="m", ylabel="m")
    plot.plot(
        *(axes @ (positions - positions.mean(axis=0)).T), color=TRAJECTORY, linewidth=1.5, label="camera trajectory"
    )
    for closure in closures:
        _draw_closure(plot, truth, closure, axes, positions.mean(axis=0))
    plot.set_title(f"{len(closures)} constraints, green where true, red where false")
    with whole_file(file) as drawn:
        figure.savefig(drawn, dpi=120, format=file.suffix.removeprefix(".") or None)


def _draw_closure(plot: object, truth: Truth, closure: LoopClosure, axes: Array, middle: Array) -> None:
    ends = [truth.at(stamp_ns) for stamp_ns in (closure.from_ns, closure.to_ns)]
    error = truth.error(closure)
    if error is None or any(end is None for end in ends):
        return
    flat = axes @ (np.array([T[:3, 3] for T in ends if T is not None]) - middle).T
    colour = RIGHT if within(error, FALSE) else WRONG
    plot.plot(*flat, color=colour, marker="o", markersize=3, linewidth=1.0)  # type: ignore[attr-defined]
