# SPDX-License-Identifier: Apache-2.0
"""The camera of a TUM RGB-D folder: ``camera.yaml``, and what is assumed where that says nothing.

The file has the keys below, or is one of ROS's camera_calibration, to which ``depth_scale`` may be added.

The benchmark's own advice for sequences without calibration is ROS's default camera, 525 px for pictures that are 640
wide, and depth in steps of 0.2 mm. See Sturm et al., "A Benchmark for the Evaluation of RGB-D SLAM Systems" (2012).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from objreg_ros.bridge.calibration import of_mapping
from objreg_ros.data import Intrinsics
from objreg_ros.lens import require_model
from objreg_ros.recording.text import SETTINGS_BYTES, read_text

FOCAL_PX, FOCAL_WIDTH = 525.0, 640  # the default camera's focal length, and of which width of a picture it is
DEPTH_SCALE = 5000.0  # steps of depth in a metre
PINHOLE = ("fx", "fy", "cx", "cy")
KEYS = (*PINHOLE, "width", "height", "depth_scale", "distortion")


@dataclass(frozen=True, slots=True)
class TumCamera:
    """The pinhole camera, the steps of its depth in a metre and its plumb-bob distortion.

    ``notes`` say what was assumed, for the user.
    """

    intrinsics: Intrinsics
    depth_scale: float
    distortion: tuple[float, ...]
    notes: tuple[str, ...] = ()


def read_camera(file: Path, width: int, height: int) -> TumCamera:
    """The camera in ``file``, whose pictures have so many pixels; the default one where there is no file.

    ValueError for what is no camera, or if the file gives none of fx fy cx cy.
    """
    told = _told(file) if file.exists() else {}
    assumed = _default(width, height)
    values = {"width": width, "height": height, "distortion": (0.0,) * 5, **assumed, **told}
    try:
        numbers = {name: float(values[name]) for name in PINHOLE}
        intrinsics = Intrinsics(**numbers, width=int(values["width"]), height=int(values["height"]))
        scale, distortion = _depth_scale(values["depth_scale"]), _distortion(values["distortion"])
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(
            f"{file}: expected numbers fx fy cx cy width height depth_scale, and a list of them as distortion, "
            f"got: {error}"
        ) from error
    return TumCamera(intrinsics, scale, distortion, tuple(_notes(file, told, assumed)))


def _default(width: int, height: int) -> dict[str, float]:
    """The default camera for pictures of a size: it sees as much to the sides, and looks through their middle."""
    focal = FOCAL_PX * width / FOCAL_WIDTH
    return {"fx": focal, "fy": focal, "cx": (width - 1) / 2, "cy": (height - 1) / 2, "depth_scale": DEPTH_SCALE}


def _told(file: Path) -> dict[str, Any]:
    """What the file says, by key. A key without a value says nothing."""
    text = read_text(file, SETTINGS_BYTES)
    try:
        values = yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ValueError(f"{file}: expected YAML, got: {' '.join(str(error).split())}") from error
    if not isinstance(values, dict):
        raise ValueError(f"{file}: expected a mapping like fx: 525.0, got {type(values).__name__}")
    told = {str(key): value for key, value in values.items() if value is not None}
    if "camera_matrix" in told:
        return _of_calibration(file, told)
    if not any(name in told for name in PINHOLE):
        got = ", ".join(told) or "nothing"
        raise ValueError(
            f"{file}: expected fx, fy, cx, cy (pixels) and depth_scale (steps of depth in a metre), got {got}; "
            "name them so, or remove the file for the benchmark's default camera"
        )
    return told


def _of_calibration(file: Path, told: Mapping[str, Any]) -> dict[str, Any]:
    """The keys of ours for a file of camera_calibration."""
    try:
        camera = of_mapping(told)
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from error
    if any(camera.d) and camera.distortion_model != "plumb_bob":
        raise ValueError(
            f"{file}: expected the model plumb_bob, got {camera.distortion_model}; name this file with --camera instead"
        )
    found = dict(zip(PINHOLE, (camera.k[0], camera.k[4], camera.k[2], camera.k[5]), strict=True))
    size = {"width": camera.width, "height": camera.height} if camera.width else {}
    scale = {"depth_scale": told["depth_scale"]} if "depth_scale" in told else {}
    return {**found, **size, **scale, **({"distortion": list(camera.d)} if camera.d else {})}


def _notes(file: Path, told: Mapping[str, Any], assumed: Mapping[str, float]) -> list[str]:
    """What the file does not say, and what it says that nobody asked for."""
    missing = ", ".join(f"{name} {value:g}" for name, value in assumed.items() if name not in told)
    unknown = ", ".join(name for name in told if name not in KEYS)
    if not told:
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
