# SPDX-License-Identifier: Apache-2.0
"""A camera that somebody names, where no camera_info does: numbers, or a file as calibration tools write it.

A `Calibration` has the fields of a sensor_msgs/CameraInfo, so whatever reads one takes the other. It is of the whole
picture of one size, or, if it names none, of whatever size comes.
"""

from __future__ import annotations

import math
import stat
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from reprlib import repr as brief
from types import SimpleNamespace
from typing import Any

from objreg_ros import limits
from objreg_ros.bridge.camera.calibration_files import FORMS, CameraFile, parse_camera
from objreg_ros.bridge.messages.pictures import size_of
from objreg_ros.lens import UPRIGHT, require_model

FILE_BYTES = 1 << 20  # a thousand times what is usual: YAML takes long
PINHOLE = ("fx", "fy", "cx", "cy")
FORM = f"fx,fy,cx,cy or fx,fy,cx,cy,width,height in pixels, or {FORMS}"
SAME_SHAPE = 0.01  # of a side that a picture may have more or less than the scaled one: sizes are rounded
MATRICES = {"camera_matrix": 9, "rectification_matrix": 9, "projection_matrix": 12}

Numbers = tuple[float, ...]


@dataclass(frozen=True)
class Calibration:
    """A camera as in a sensor_msgs/CameraInfo; ``width`` and ``height`` are 0 where it fits any picture.

    ``k`` (9), ``r`` (9) and ``p`` (12) are matrices by rows, in pixels whose centres are on integers, ``d`` the
    coefficients of ``distortion_model``. ValueError for a camera without a focal length, and for a lens that is none.
    """

    k: Numbers
    width: int = 0
    height: int = 0
    distortion_model: str = "plumb_bob"
    d: Numbers = ()
    r: Numbers = UPRIGHT
    p: Numbers = (0.0,) * 12
    binning_x: int = 0
    binning_y: int = 0
    roi: Any = field(
        default_factory=lambda: SimpleNamespace(x_offset=0, y_offset=0, width=0, height=0, do_rectify=False),
        compare=False,
    )

    def __post_init__(self) -> None:
        for name in ("k", "d", "r", "p"):
            if not all(map(math.isfinite, getattr(self, name))):
                raise ValueError(f"expected finite numbers in {name.upper()}, got {getattr(self, name)}")
        if self.k[0] <= 0 or self.k[4] <= 0:
            sign = "; of an fy below 0, as ICL-NUIM has it, leave out the sign" if self.k[4] < 0 < self.k[0] else ""
            raise ValueError(f"expected focal lengths above 0, got {self.k[0]:g} and {self.k[4]:g}{sign}")
        sides = self.width, self.height
        if sides != (0, 0) and not all(0 < side <= limits.MOST_SIDE for side in sides):
            raise ValueError(f"expected a width and height of 1 to {limits.MOST_SIDE}, got {sides[0]} × {sides[1]}")
        if any(self.d):
            require_model("equidistant" if self.distortion_model == "fisheye" else self.distortion_model, self.d)

    def of_size(self, width: int, height: int) -> Calibration:
        """The same camera where its whole picture comes with another number of pixels.

        ValueError for a picture of another shape: it is cut, and the file does not say where.
        """
        if (self.width, self.height) in ((0, 0), (width, height)):
            return replace(self, width=width, height=height)
        across, down = width / self.width, height / self.height
        if abs(across / down - 1.0) > SAME_SHAPE:
            raise ValueError(
                f"camera: expected a picture of {self.width} × {self.height} or of that shape, got {width} × {height}; "
                "calibrate the camera in this mode"
            )
        k, p = _scaled(self.k, 3, across, down), _scaled(self.p, 4, across, down)
        return replace(self, k=k, p=p, width=width, height=height)


def read_calibration(given: str) -> Calibration:
    """The camera that a user names: numbers ``fx,fy,cx,cy[,width,height]``, or a file.

    OSError for a file that is not there, ValueError for what is no camera: both say what was expected.
    """
    return read_camera(given)[0]


def read_camera(given: str) -> tuple[Calibration, tuple[str, ...]]:
    """As `read_calibration`, with notes for the user on what was chosen of a file."""
    numbers = _numbers_of(given)
    if numbers is not None:
        return of_numbers(numbers), ()
    file = Path(given).expanduser()
    if not file.exists():
        raise FileNotFoundError(f"camera: expected {FORM}, got {given!r}, which is no file")
    try:
        parsed = parse_camera(read_camera_text(file))
        return of_file(parsed), tuple(f"{file.name}: {note}" for note in parsed.notes)
    except ValueError as error:
        raise ValueError(f"camera: {file}: {error}") from error


def of_file(parsed: CameraFile) -> Calibration:
    """The camera that was parsed of a file."""
    return of_mapping(parsed.values)


def absolute(given: str) -> str:
    """What names the same camera wherever it is read."""
    return given if not given or _numbers_of(given) is not None else str(Path(given).expanduser().resolve())


def of_numbers(numbers: Numbers) -> Calibration:
    """A pinhole camera of fx fy cx cy, and of width and height where these are given."""
    if len(numbers) not in (4, 6):
        raise ValueError(f"camera: expected {FORM}, got {len(numbers)} numbers")
    if any(side != int(side) if math.isfinite(side) else True for side in numbers[4:]):
        raise ValueError(f"camera: expected whole pixels of width and height, got {numbers[4]:g} and {numbers[5]:g}")
    try:
        width, height = map(int, numbers[4:] or (0, 0))
        return Calibration(_matrix(*numbers[:4]), width, height)
    except ValueError as error:
        raise ValueError(f"camera: {error}") from error


def of_mapping(values: Mapping[str, Any]) -> Calibration:
    """The camera of a file of camera_calibration, by its keys: without the name, whose matrices it may do without
    but for camera_matrix. ValueError, with what was expected, for what it is not."""
    if values.get("camera_matrix") is None:
        got = ", ".join(map(str, values)) or "nothing"
        raise ValueError(f"expected image_width, image_height, camera_matrix and the like, got {got[:200]}")
    matrices = {
        name: _matrix_of(values, name, count) for name, count in MATRICES.items() if values.get(name) is not None
    }
    return Calibration(
        k=matrices["camera_matrix"],
        width=_pixels(values, "image_width"),
        height=_pixels(values, "image_height"),
        distortion_model=_model(values.get("distortion_model") or "plumb_bob"),
        d=_matrix_of(values, "distortion_coefficients") if values.get("distortion_coefficients") is not None else (),
        r=matrices.get("rectification_matrix", UPRIGHT),
        p=matrices.get("projection_matrix", (0.0,) * 12),
    )


def fitted(camera_info: Any, message: Any) -> Any:
    """A camera for the picture or cloud that it is of: a `Calibration` in its size, a message of ROS as it is.

    None stays None. ValueError for a picture of another shape, and for a cloud that is not organised where the camera,
    which alone could give the number of pixels, does not.
    """
    if not isinstance(camera_info, Calibration):
        return camera_info
    if hasattr(message, "point_step") and min(int(message.width), int(message.height)) <= 1:
        if not camera_info.width:
            raise ValueError("camera: expected fx,fy,cx,cy,width,height for points that are not organised, got no size")
        return camera_info
    return _of_size(camera_info, *size_of(message))


@lru_cache(maxsize=4)
def _of_size(camera: Calibration, width: int, height: int) -> Calibration:
    return camera.of_size(width, height)


def _numbers_of(given: str) -> Numbers | None:
    """The numbers between commas; None where some are none, so that it must be a file's name."""
    try:
        return tuple(float(text) for text in given.strip().strip("[]").split(","))
    except ValueError:
        return None


def _matrix(fx: float, fy: float, cx: float, cy: float) -> Numbers:
    return fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0


def _scaled(matrix: Numbers, columns: int, across: float, down: float) -> Numbers:
    """A camera matrix by rows for so many times the pixels; zeros stay. The middle of a pixel is on an integer."""
    if not matrix[0]:
        return matrix
    first, second = list(matrix[:columns]), list(matrix[columns : 2 * columns])
    scaled = [across * value for value in first], [down * value for value in second]
    scaled[0][2] += (across - 1) / 2
    scaled[1][2] += (down - 1) / 2
    return (*scaled[0], *scaled[1], *matrix[2 * columns :])


def read_camera_text(file: Path) -> str:
    """The text of a file of a camera; ValueError for what is no regular file, too long or no UTF-8."""
    status = file.stat()
    if not stat.S_ISREG(status.st_mode):
        raise ValueError("expected a regular file, got something else")
    if status.st_size > FILE_BYTES:
        raise ValueError(f"expected at most {FILE_BYTES} bytes, got {status.st_size}; is it the right file?")
    return file.read_bytes().decode("utf-8-sig")  # what is no UTF-8 is a ValueError


def _matrix_of(values: Mapping[str, Any], name: str, count: int | None = None) -> Numbers:
    """The numbers of a matrix, which are its ``data`` or the list itself."""
    given = values[name]
    data = given.get("data") if isinstance(given, Mapping) else given
    if isinstance(data, list) and data and all(isinstance(row, list) for row in data):
        data = [value for row in data for value in row]
    if not isinstance(data, list) or not all(isinstance(value, int | float) for value in data):
        raise ValueError(f"expected {name} with its numbers as data: [1.0, 0.0, …], got {brief(given)[:80]}")
    if count is not None and len(data) != count:
        raise ValueError(f"expected {count} numbers in {name}, got {len(data)}")
    try:
        return tuple(float(value) for value in data)
    except OverflowError as error:
        raise ValueError(f"expected numbers in {name} that are not too long, got: {error}") from error


def _model(given: Any) -> str:
    if not isinstance(given, str):
        raise ValueError(f"expected a name as distortion_model, got {brief(given)[:80]}")
    return given


def _pixels(values: Mapping[str, Any], name: str) -> int:
    value = values.get(name, 0)
    if not isinstance(value, int) or value < 0:
        raise ValueError(f"expected whole pixels as {name}, got {brief(value)[:80]}")
    return value
