# SPDX-License-Identifier: Apache-2.0
"""The files that tools write of a camera, brought to the keys of ROS's camera_calibration.

A form is known by what it holds, never by the name of its file. What YAML, JSON and OpenCV's own storage have in
common is a mapping; ost.txt and bare matrices are text of their own.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from reprlib import repr as brief
from typing import Any

import cv2
import yaml

FORMS = (
    "a file of ROS (camera_calibration's YAML or ost.txt, or what `ros2 topic echo --once …/camera_info` prints), "
    "OpenCV (FileStorage), RTAB-Map, ORB-SLAM, kalibr (camchain) or Open3D (JSON), one with fx, fy, cx and cy, "
    "or a matrix of 3 × 3"
)
PINHOLE = ("fx", "fy", "cx", "cy")
LEAST_DEPTH_SCALE = 1.0  # steps in a metre: ORB-SLAM writes 1.0 where depth is metres already
KALIBR = {"radtan": "plumb_bob", "equidistant": "equidistant", "equi": "equidistant", "none": "plumb_bob"}
ROS_ECHO = re.compile(r"^header:", re.MULTILINE)  # before it are the warnings of the command
OST = {
    "camera matrix": "camera_matrix",
    "distortion": "distortion_coefficients",
    "rectification": "rectification_matrix",
    "projection": "projection_matrix",
}
DEEPEST = 8  # mappings in mappings of OpenCV


@dataclass(frozen=True)
class CameraFile:
    """A camera as a file gives it: ``values`` by the keys of camera_calibration, and what those have no key for.

    ``depth_scale`` is the steps of depth in a metre, None where the file does not say; ``notes`` are for the user.
    """

    values: Mapping[str, Any]
    depth_scale: Any = None
    notes: tuple[str, ...] = field(default=())


def parse_camera(text: str) -> CameraFile:
    """The camera in the text of a file. ValueError, with the forms that are known, for another text."""
    for parse in (_of_numbers, _of_ost):
        if (found := parse(text)) is not None:
            return found
    values = _mapping(text)
    for read in READERS:
        if (found := read(values)) is not None:
            return found
    got = ", ".join(map(str, values))[:200] or "nothing"
    raise ValueError(f"expected {FORMS}, got the keys {got}")


def _mapping(text: str) -> Mapping[str, Any]:
    begins = text.lstrip()[:6]
    if begins.startswith(("%YAML:", "<?xml")) or "!!opencv-" in text:
        return _of_file_storage(text)
    try:
        values = json.loads(text) if begins.startswith("{") else _first_document(text)
    except json.JSONDecodeError:
        values = _first_document(text)
    except RecursionError as error:
        raise ValueError(f"expected {FORMS}, got: {error}") from error
    if not isinstance(values, dict):
        raise ValueError(f"expected {FORMS}, got {type(values).__name__}")
    return values


def _first_document(text: str) -> Any:
    """The first document of YAML that has anything; `ros2 topic echo` ends each with ---."""
    start = ROS_ECHO.search(text)
    if start is not None and re.search(r"^[kK]:", text, re.MULTILINE):
        text = text[start.start() :]
    try:
        return next((values for values in yaml.safe_load_all(text) if values is not None), None)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ValueError(f"expected YAML, got: {' '.join(str(error).split())}") from error


def _of_file_storage(text: str) -> dict[str, Any]:
    """What OpenCV's storage of settings holds, in YAML or XML."""
    if not text.lstrip().startswith("<"):  # of its versions one reads what another writes only with this header
        text = "%YAML:1.0\n" + re.sub(r"\A\s*%YAML.*\n", "", text)
    try:
        storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        root = storage.root()
        return {name: _plain(root.getNode(name), DEEPEST) for name in root.keys()}  # noqa: SIM118  no mapping
    except (cv2.error, SystemError) as error:
        raise ValueError(f"expected OpenCV's YAML or XML, got: {' '.join(str(error).split())[:200]}") from error


def _plain(node: Any, depth: int) -> Any:
    """A node of OpenCV's storage as Python has it; a matrix as the mapping that it is written as."""
    if node.isInt():
        return int(node.real())
    if node.isReal():
        return float(node.real())
    if node.isString():
        return node.string()
    if depth and node.isSeq():
        return [_plain(node.at(k), depth - 1) for k in range(node.size())]
    names = node.keys() if depth and node.isMap() else ()
    return {name: _plain(node.getNode(name), depth - 1) for name in names} or None


# ------------------------------------------------------------------------------------------------- one form at a time


def _of_calibration(values: Mapping[str, Any]) -> CameraFile | None:
    """ROS's camera_calibration, RTAB-Map, and OpenCV's example, which names no model; also of OpenCV's older names."""
    named = {_lower(name): value for name, value in values.items()}
    if named.get("camera_matrix") is None:
        return None
    lens = next((named[name] for name in ("distortion_coefficients", "dist_coeffs", "distortion") if name in named), ())
    size = named.get("image_size") or (0, 0)
    known = {
        **named,
        "image_width": named.get("image_width", size[0] if isinstance(size, Sequence) else 0),
        "image_height": named.get("image_height", size[1] if isinstance(size, Sequence) and len(size) > 1 else 0),
        "distortion_coefficients": lens or None,
        "distortion_model": named.get("distortion_model") or _model_of(lens),
    }
    return CameraFile(known, named.get("depth_scale"))


def _of_camera_info(values: Mapping[str, Any]) -> CameraFile | None:
    """A sensor_msgs/CameraInfo of ROS 1 or 2; ValueError for one of a part of the picture."""
    named = {_lower(name): value for name, value in values.items()}
    if named.get("k") is None:
        return None
    roi = named.get("roi") if isinstance(named.get("roi"), Mapping) else {}
    cut = {name: n for name in ("x_offset", "y_offset", "width", "height") if (n := (roi or {}).get(name))}
    binned = [n for name in ("binning_x", "binning_y") if (n := named.get(name)) not in (None, 0, 1)]
    if cut or binned:
        raise ValueError(
            f"expected a camera_info of the whole picture, got roi {cut} and binning {binned}; take it in full mode"
        )
    names = {"width": "image_width", "height": "image_height", "k": "camera_matrix", "r": "rectification_matrix",
             "p": "projection_matrix", "distortion_model": "distortion_model"}  # fmt: skip
    known = {to: named[name] for name, to in names.items() if named.get(name) is not None}
    return CameraFile({**known, "distortion_coefficients": named.get("d") or None})


def _of_orb_slam(values: Mapping[str, Any]) -> CameraFile | None:
    """The settings of ORB-SLAM2 and 3: ``Camera.fx``, of which 3 says ``Camera1.fx``."""
    prefix = next((name for name in ("Camera1", "Camera") if f"{name}.fx" in values), None)
    if prefix is None:
        return None
    fisheye = "kannala" in str(values.get("Camera.type", "")).lower()
    names = ("k1", "k2", "k3", "k4") if fisheye else ("k1", "k2", "p1", "p2", "k3")
    numbers = {name: values.get(f"{prefix}.{name}") for name in PINHOLE}
    fy: Any = numbers["fy"]
    upwards = isinstance(fy, int | float) and fy < 0  # ICL-NUIM: rows of pictures count downwards nevertheless
    known = _pinhole({**numbers, "fy": -fy if upwards else fy})
    known |= {"image_width": values.get("Camera.width", 0), "image_height": values.get("Camera.height", 0)}
    known["distortion_coefficients"] = [values.get(f"{prefix}.{name}", 0.0) for name in names]
    known["distortion_model"] = "equidistant" if fisheye else "plumb_bob"
    scale = values.get("RGBD.DepthMapFactor", values.get("DepthMapFactor"))
    has_scale = isinstance(scale, int | float) and scale > LEAST_DEPTH_SCALE
    return CameraFile(known, scale if has_scale else None, (f"fy {fy:g} is taken without its sign",) if upwards else ())


def _of_kalibr(values: Mapping[str, Any]) -> CameraFile | None:
    """A camchain of kalibr; of several cameras the first, which is said."""
    cameras = sorted((name for name in values if re.fullmatch(r"cam\d+", str(name))), key=lambda name: int(name[3:]))
    first = values[cameras[0]] if cameras else None
    if not isinstance(first, Mapping) or "intrinsics" not in first:
        return None
    kind, lens = first.get("camera_model", "pinhole"), str(first.get("distortion_model") or "none")
    numbers = first["intrinsics"]
    if kind != "pinhole" or lens not in KALIBR or not isinstance(numbers, Sequence) or len(numbers) != 4:
        expected = f"{cameras[0]} with camera_model pinhole, distortion_model {', '.join(KALIBR)} and 4 intrinsics"
        raise ValueError(f"expected {expected}, got {kind}, {lens} and {brief(numbers)}; calibrate it so with kalibr")
    size = first.get("resolution") or (0, 0)
    if not isinstance(size, Sequence) or len(size) != 2:
        raise ValueError(f"expected resolution: [width, height] of {cameras[0]}, got {brief(size)}")
    known = _pinhole(dict(zip(PINHOLE, numbers, strict=True)))
    known |= {"image_width": size[0], "image_height": size[1], "distortion_model": KALIBR[lens]}
    known["distortion_coefficients"] = [] if lens == "none" else first.get("distortion_coeffs") or []
    rest = ", ".join(cameras[1:])
    note = f"the file has several cameras: {cameras[0]} is used, and not {rest}; leave only the right one in it if not"
    return CameraFile(known, notes=(note,) if rest else ())


def _of_open3d(values: Mapping[str, Any]) -> CameraFile | None:
    """Open3D's pinhole camera, also within the parameters of a view; its matrix is written by columns."""
    inner = values.get("intrinsic")
    known = inner if isinstance(inner, Mapping) else values
    matrix = known.get("intrinsic_matrix")
    if matrix is None:
        return None
    rows = _flat(matrix)
    if len(rows) == 9 and not any((rows[2], rows[5])):
        rows = [rows[3 * column + row] for row in range(3) for column in range(3)]
    values_of = {"camera_matrix": rows, "image_width": known.get("width", 0), "image_height": known.get("height", 0)}
    return CameraFile(values_of, known.get("depth_scale"))


def _of_pinhole(values: Mapping[str, Any]) -> CameraFile | None:
    """``fx``, ``fy``, ``cx`` and ``cy`` by name, also one mapping deeper, as in the settings of neural SLAM."""
    nested = (inner for inner in values.values() if isinstance(inner, Mapping))
    known = next((one for one in (values, *nested) if all(one.get(name) is not None for name in PINHOLE)), None)
    if known is None:
        return None
    width, height = (
        next((known[n] for n in names if n in known), 0) for names in (("width", "w", "W"), ("height", "h", "H"))
    )
    made = {**_pinhole(known), "image_width": width, "image_height": height}
    scale = next((known[name] for name in ("depth_scale", "png_depth_scale", "scale") if name in known), None)
    return CameraFile({**made, "distortion_coefficients": known.get("distortion") or None}, scale)


READERS: tuple[Callable[[Mapping[str, Any]], CameraFile | None], ...] = (
    _of_calibration,
    _of_camera_info,
    _of_orb_slam,
    _of_kalibr,
    _of_open3d,
    _of_pinhole,
)


def _of_numbers(text: str) -> CameraFile | None:
    """A bare matrix of 3 × 3 or 4 × 4 by rows, or fx fy cx cy in one line; None for other text."""
    lines = [[part for part in re.split(r"[\s,;\[\]]+", line) if part] for line in text.splitlines()]
    rows = [line for line in lines if line and not line[0].startswith("#")]
    if [len(row) for row in rows] not in ([3] * 3, [4] * 4, [4]):
        return None
    try:
        numbers = [[float(part) for part in row] for row in rows]
    except ValueError:
        return None
    if len(numbers) == 1:
        return CameraFile(_pinhole(dict(zip(PINHOLE, numbers[0], strict=True))))
    return CameraFile({"camera_matrix": [number for row in numbers[:3] for number in row[:3]]})


def _of_ost(text: str) -> CameraFile | None:
    """The ost.txt that camera_calibration writes beside its YAML; None for other text."""
    lines = [line.strip() for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    if "camera matrix" not in lines or "[image]" not in lines:
        return None
    known: dict[str, Any] = {}
    for k, line in enumerate(lines):
        if line in ("width", "height") and k + 1 < len(lines):
            known[f"image_{line}"] = int(lines[k + 1]) if lines[k + 1].isdecimal() else lines[k + 1]
        elif line in OST:
            known[OST[line]] = _numbers_below(lines[k + 1 :])
    known["distortion_model"] = _model_of(known.get("distortion_coefficients", ()))
    return CameraFile(known)


def _numbers_below(lines: Sequence[str]) -> list[float]:
    """The numbers of the lines up to the first that has others."""
    numbers: list[float] = []
    for line in lines:
        try:
            numbers += [float(part) for part in line.split()]
        except ValueError:
            break
    return numbers


def _pinhole(known: Mapping[str, Any]) -> dict[str, Any]:
    """fx, fy, cx and cy as a camera matrix; ValueError where one is not said."""
    if missing := [name for name in PINHOLE if known.get(name) is None]:
        raise ValueError(f"expected fx, fy, cx and cy, got none for {', '.join(missing)}")
    fx, fy, cx, cy = (known[name] for name in PINHOLE)
    return {"camera_matrix": [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]}


def _model_of(lens: Any) -> str:
    """The model of ROS for coefficients of OpenCV, which does not name it: up to five, or more."""
    return "rational_polynomial" if len(_flat(lens)) > 5 else "plumb_bob"


def _flat(matrix: Any) -> list[Any]:
    """The numbers of a matrix as one list: of a mapping its ``data``, of rows one after the other."""
    data = matrix.get("data", ()) if isinstance(matrix, Mapping) else matrix
    if not isinstance(data, Sequence) or isinstance(data, str):
        return []
    return [value for row in data for value in (row if isinstance(row, list) else [row])]


def _lower(name: Any) -> str:
    """A key of OpenCV's examples in small letters with _: ``cameraMatrix``, ``Camera_Matrix``."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", str(name)).lower()
