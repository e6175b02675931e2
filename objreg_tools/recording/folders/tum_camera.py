# SPDX-License-Identifier: Apache-2.0
"""The camera of a TUM RGB-D folder: ``camera.yaml``, and what is assumed where that says nothing.

The file has the keys below, or is one that a calibration tool wrote (`bridge/camera/calibration_files.py`), to which
``depth_scale`` may be added. It may be of the colour pictures where those are larger than depth.

The benchmark's own advice for sequences without calibration is ROS's default camera, 525 px for pictures that are 640
wide, and depth in steps of 0.2 mm. See Sturm et al., "A Benchmark for the Evaluation of RGB-D SLAM Systems" (2012).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from objreg_ros.bridge.camera.calibration import SAME_SHAPE, of_file
from objreg_ros.bridge.camera.calibration_files import parse_camera
from objreg_ros.data.images import Intrinsics
from objreg_ros.lens import require_model
from objreg_tools.recording.folders.text import SETTINGS_BYTES, read_text

FOCAL_PX, FOCAL_WIDTH = 525.0, 640  # the default camera's focal length, and of which width of a picture it is
DEPTH_SCALE = 5000.0  # steps of depth in a metre
PINHOLE = ("fx", "fy", "cx", "cy")
KEYS = (*PINHOLE, "width", "height", "depth_scale", "distortion")
NAMES = ("camera.yaml", "camera.yml", "camera.json")
UPWARDS = "{}: fy {:g} is taken as {:g}: rows of pictures count downwards, whatever its own y axis does"

Size = tuple[int, int]  # width, height


@dataclass(frozen=True, slots=True)
class TumCamera:
    """The pinhole camera, the steps of its depth in a metre and its plumb-bob distortion.

    ``notes`` say what was assumed, for the user.
    """

    intrinsics: Intrinsics
    depth_scale: float
    distortion: tuple[float, ...]
    notes: tuple[str, ...] = ()

    @property
    def size(self) -> Size:
        """Width and height of the pictures that it is of, in pixels."""
        return self.intrinsics.width, self.intrinsics.height


def camera_file(folder: Path) -> Path:
    """The file of the camera in a folder; the first of the names that it may have where there is none."""
    return next((folder / name for name in NAMES if (folder / name).exists()), folder / NAMES[0])


def read_camera(file: Path, width: int, height: int, colour: Size | None = None) -> TumCamera:
    """The camera in ``file`` for depth pictures of this size; the default one where there is no file.

    ``colour`` is the size of the colour pictures: a file of those is scaled to depth, and that is said. ValueError for
    what is no camera, or if the file gives none of fx fy cx cy.
    """
    given, notes = _given(file) if file.exists() else ({}, [])
    size = _size_of(given, (width, height), colour or (width, height))
    assumed = _default(*size)
    values = {"width": size[0], "height": size[1], "distortion": (0.0,) * 5, **assumed, **given}
    try:
        intrinsics = Intrinsics(**{name: float(values[name]) for name in PINHOLE}, width=size[0], height=size[1])
        scale, distortion = _depth_scale(values["depth_scale"]), _distortion(values["distortion"])
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(
            f"{file}: expected numbers fx fy cx cy width height depth_scale, and a list of them as distortion, "
            f"got: {error}"
        ) from error
    fitting = scaled(intrinsics, width, height)
    if given and fitting is not intrinsics:
        notes = [*notes, f"{file.name} is of pictures of {size[0]} × {size[1]}: scaled to depth's {width} × {height}"]
    return TumCamera(fitting, scale, distortion, (*_notes(file, given, assumed), *notes))


def scaled(camera: Intrinsics, width: int, height: int) -> Intrinsics:
    """The camera of the same pictures with another number of pixels; itself where these are of another shape.

    The middle of a pixel is on an integer.
    """
    across, down = width / camera.width, height / camera.height
    if (width, height) == (camera.width, camera.height) or abs(across / down - 1.0) > SAME_SHAPE:
        return camera
    cx, cy = across * camera.cx + (across - 1) / 2, down * camera.cy + (down - 1) / 2
    return Intrinsics(fx=across * camera.fx, fy=down * camera.fy, cx=cx, cy=cy, width=width, height=height)


def _size_of(given: Mapping[str, Any], depth: Size, colour: Size) -> Size:
    """Width and height of the pictures that a file is of: as it says, else by which of the two its centre halves."""
    try:
        if given.get("width") or given.get("height"):
            return int(given.get("width", depth[0])), int(given.get("height", depth[1]))
        cx = float(given.get("cx", depth[0] / 2))
    except (TypeError, ValueError, OverflowError):
        return depth  # the error is reported where all is read
    return colour if cx > math.sqrt(depth[0] * colour[0]) / 2 else depth


def _default(width: int, height: int) -> dict[str, float]:
    """The default camera for pictures of a size: it sees as much to the sides, and looks through their middle."""
    focal = FOCAL_PX * width / FOCAL_WIDTH
    return {"fx": focal, "fy": focal, "cx": (width - 1) / 2, "cy": (height - 1) / 2, "depth_scale": DEPTH_SCALE}


def _given(file: Path) -> tuple[dict[str, Any], list[str]]:
    """The values of the file, by key, and notes on it. A key without a value is left out."""
    text = read_text(file, SETTINGS_BYTES)
    given = _own_keys(text)
    if given is None:
        return _of_calibration(file, text)
    fy = given.get("fy")
    if isinstance(fy, int | float) and fy < 0:  # ICL-NUIM
        return {**given, "fy": -fy}, [UPWARDS.format(file.name, fy, -fy)]
    return given, []


def _own_keys(text: str) -> dict[str, Any] | None:
    """The keys of a file in our own form; None for another text."""
    try:
        values = yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, RecursionError):
        return None
    given = {str(key): value for key, value in values.items() if value is not None} if isinstance(values, dict) else {}
    return given if any(name in given for name in PINHOLE) else None


def _of_calibration(file: Path, text: str) -> tuple[dict[str, Any], list[str]]:
    """The keys of ours for a file of a calibration tool."""
    try:
        parsed = parse_camera(text)
        camera = of_file(parsed)
    except ValueError as error:
        raise ValueError(
            f"{file}: {error}; name fx, fy, cx, cy (pixels) and depth_scale (steps of depth in a metre), or remove the "
            "file for the benchmark's default camera"
        ) from error
    if any(camera.d) and camera.distortion_model not in ("plumb_bob", "rational_polynomial"):
        raise ValueError(
            f"{file}: expected the model plumb_bob, got {camera.distortion_model}; name this file with --camera instead"
        )
    found = dict(zip(PINHOLE, (camera.k[0], camera.k[4], camera.k[2], camera.k[5]), strict=True))
    size = {"width": camera.width, "height": camera.height} if camera.width else {}
    scale = {"depth_scale": parsed.depth_scale} if parsed.depth_scale is not None else {}
    lens = {"distortion": list(camera.d)} if camera.d else {}
    return {**found, **size, **scale, **lens}, [f"{file.name}: {note}" for note in parsed.notes]


def _notes(file: Path, given: Mapping[str, Any], assumed: Mapping[str, float]) -> list[str]:
    """Notes on missing values, which are assumed, and on unknown keys."""
    missing = ", ".join(f"{name} {value:g}" for name, value in assumed.items() if name not in given)
    unknown = ", ".join(name for name in given if name not in KEYS)
    if not given:
        return [f"no {file.name}: the benchmark's default camera is assumed ({missing})"]
    notes = [f"{file.name} does not give all of the camera, so this is assumed: {missing}"] if missing else []
    return [*notes, *([f"{file.name}: not known, and not used: {unknown}"] if unknown else [])]


def _depth_scale(value: Any) -> float:
    """Steps of depth in a metre; ValueError for what depth cannot be divided by."""
    scale = float(value)
    if not 0 < scale < float("inf"):
        raise ValueError(f"depth_scale {scale}, which is none above 0")
    return scale


def _distortion(value: Any) -> tuple[float, ...]:
    if isinstance(value, str) or not hasattr(value, "__iter__"):
        raise ValueError(f"distortion {value!r}, which is no list like [0.1, -0.2, 0, 0, 0]")
    numbers = tuple(float(number) for number in value)
    if any(numbers):
        require_model("plumb_bob", numbers)
    return numbers
