# SPDX-License-Identifier: Apache-2.0
"""Recordings of the app Record3D: an .r3d file, which is a ZIP, or a folder that was exported or unpacked of one.

``metadata`` is JSON with the camera of colour (K by columns, w, h), the poses of ARKit (qx qy qz qw tx ty tz, camera
axes x right, y up, z backwards) and the times of the frames. Colour is ``rgbd/N.jpg`` or ``rgb/N.jpg``; depth in metres
is ``rgbd/N.depth`` (LZFSE) or ``depth/N`` as .npy or .exr, or as .png in millimetres.
"""

from __future__ import annotations

import json
import re
import zipfile
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, Self

import cv2
import numpy as np

from objreg_ros.bridge.camera.calibration import of_mapping
from objreg_ros.data.checked import Array
from objreg_tools.recording.folders.folder import (
    CAMERA_FRAME,
    DEPTH,
    IMAGE,
    FolderRecording,
    FrameFiles,
    info_moment,
    odometry_moment,
    pose_of_numbers,
)
from objreg_tools.recording.folders.picture_files import (
    COLOUR,
    MILLIMETRES,
    Size,
    brought_to,
    decode_picture,
    larger_colour,
)
from objreg_tools.recording.folders.record3d_depth import metres_of
from objreg_tools.recording.folders.scannet import scaled_camera
from objreg_tools.recording.folders.text import require_regular
from objreg_tools.recording.poses import passed_over
from objreg_tools.recording.rosbag import messages

METADATA = ("metadata", "metadata.json")
COLOUR_NAME = re.compile(r"(?:^|/)rgbd?/(\d+)\.(?:jpg|jpeg|png)$", re.IGNORECASE)
DEPTH_NAME = re.compile(r"(?:^|/)(?:rgbd|depth)/(\d+)\.(depth|npy|exr|png)$", re.IGNORECASE)
FILE_BYTES = 1 << 26  # of one file in it, unpacked: a picture, or the poses of some hours
OPTICAL = np.diag([1.0, -1.0, -1.0, 1.0])  # T_camera_optical


class Record3dFiles:
    """The files of a recording, packed or in a folder."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._zip: zipfile.ZipFile | None = None
        if path.is_dir():
            self.names = [str(file.relative_to(path).as_posix()) for file in sorted(path.glob("*"))]
            self.names += [f"{d}/{f.name}" for d in ("rgb", "rgbd", "depth") for f in sorted((path / d).glob("*"))]
            return
        require_regular(path)
        try:
            self._zip = zipfile.ZipFile(path)
        except (zipfile.BadZipFile, ValueError, NotImplementedError) as error:
            raise ValueError(f"{path}: expected a ZIP as Record3D exports it, got: {error}; export it again") from error
        self.names = self._zip.namelist()

    def read(self, name: str) -> bytes:
        """The bytes of a file; ValueError where it is broken or too long."""
        if self._zip is None:
            size = require_regular(self.path / name)
            _require_short(self.path, name, size)
            return (self.path / name).read_bytes()
        _require_short(self.path, name, self._zip.getinfo(name).file_size)
        try:
            with self._zip.open(name) as file:
                return file.read(FILE_BYTES)
        except (zipfile.BadZipFile, EOFError, ValueError, NotImplementedError, RuntimeError, OSError) as error:
            raise ValueError(f"{self.path}: expected {name} whole, got: {error}; export it again") from error

    def close(self) -> None:
        """Let go of the file."""
        if self._zip is not None:
            self._zip.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Record3dRecording(FolderRecording):
    """A recording of Record3D; its topics are those of the graph, with ``/odom`` as ARKit measured it."""

    kind = "Record3D recording"

    def __init__(self, path: Path) -> None:
        self._source = Record3dFiles(path)
        try:
            moments, notes = _moments(self._source)
        except BaseException:
            self._source.close()
            raise
        super().__init__(path, moments, notes)

    def close(self) -> None:
        """Close the file."""
        self._source.close()


def _require_short(path: Path, name: str, size: int) -> None:
    if size > FILE_BYTES:
        raise ValueError(f"{path}: expected at most {FILE_BYTES} bytes of {name}, got {size}; is it a recording?")


def is_record3d(folder: Path) -> bool:
    """Whether a folder is one that Record3D exported."""
    return any((folder / name).is_file() for name in METADATA) and any(
        (folder / name).is_dir() for name in ("rgbd", "rgb", "depth")
    )


def _moments(source: Record3dFiles) -> tuple[list[FrameFiles], list[str]]:
    known = _metadata(source)
    colours = {int(m[1]): name for name in source.names if (m := COLOUR_NAME.search(name))}
    depths = {
        int(m[1]): name for name in source.names if (m := DEPTH_NAME.search(name)) and name not in colours.values()
    }
    both = sorted(colours.keys() & depths.keys())
    if not both:
        got = f"{len(colours)} of colour and {len(depths)} of depth"
        raise FileNotFoundError(
            f"{source.path}: expected pictures of one number in rgbd/, or in rgb/ and depth/, got {got}"
        )
    stamps, notes = _stamps(known, both, source.path)
    colour, depth = (
        _first_colour(source, [colours[n] for n in both]),
        _first_depth(source, known, [depths[n] for n in both]),
    )
    camera, of_camera = scaled_camera(_camera(known, source.path), colour, depth, MILLIMETRES, "metadata")
    moments = []
    for number, stamp_ns in zip(both, stamps, strict=True):
        picture = partial(_colour_message, source, colours[number], stamp_ns, camera.size)
        metres = partial(_depth_message, source, known, depths[number], stamp_ns)
        moments += [
            info_moment(camera, stamp_ns),
            FrameFiles(stamp_ns, IMAGE, picture),
            FrameFiles(stamp_ns, DEPTH, metres),
        ]
    odometry, of_poses = _odometry(known, both, stamps, source.path)
    return moments + odometry, [*notes, *of_camera, *larger_colour(colour, depth), *of_poses]


def _metadata(source: Record3dFiles) -> Mapping[str, Any]:
    name = next((name for name in METADATA if name in source.names), None)
    if name is None:
        got = ", ".join(source.names[:5]) or "nothing"
        raise FileNotFoundError(f"{source.path}: expected the file metadata of Record3D, got {got}; export it as .r3d")
    try:
        known = json.loads(source.read(name))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{source.path}: expected JSON in {name}, got: {str(error)[:200]}; export it again") from error
    if not isinstance(known, dict) or "K" not in known:
        raise ValueError(
            f"{source.path}: expected K, w, h and poses in {name}, got {str(known)[:80]}; export it as .r3d"
        )
    return known


def _camera(known: Mapping[str, Any], path: Path) -> Any:
    """The camera of colour; K is written by columns."""
    numbers = known["K"]
    by_rows = (
        [numbers[3 * c + r] for r in range(3) for c in range(3)]
        if isinstance(numbers, list) and len(numbers) == 9
        else []
    )
    try:
        return of_mapping(
            {"camera_matrix": by_rows, "image_width": known.get("w", 0), "image_height": known.get("h", 0)}
        )
    except ValueError as error:
        raise ValueError(f"{path}: expected K, w and h of a camera in metadata, got: {error}") from error


def _stamps(known: Mapping[str, Any], numbers: list[int], path: Path) -> tuple[list[int], list[str]]:
    """The times of the frames in ns: as they are given, else by the frames in a second."""
    times, fps = known.get("frameTimestamps"), known.get("fps")
    try:
        if isinstance(times, list) and len(times) > max(numbers):
            return [round(float(times[number]) * 1e9) for number in numbers], []
        rate = float(fps or 0)
        if not 0 < rate < 1e4:
            raise ValueError(f"fps {fps!r}")
        return [round(number * 1e9 / rate) for number in numbers], [
            f"no times of frames: {rate:g} a second by metadata"
        ]
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(
            f"{path}: expected frameTimestamps or fps in metadata, got: {error}; export it again"
        ) from error


def _odometry(
    known: Mapping[str, Any], numbers: list[int], stamps: list[int], path: Path
) -> tuple[list[FrameFiles], list[str]]:
    """The poses of the camera in its optical frame, and a note on those that are none; no pose where none is given."""
    poses = known.get("poses") or []
    moments: list[FrameFiles] = []
    for number, stamp_ns in zip(numbers, stamps, strict=True):
        if number >= len(poses):
            break
        try:
            qx, qy, qz, qw, x, y, z = map(float, poses[number])
        except (TypeError, ValueError) as error:
            raise ValueError(
                f"{path}: expected poses of qx qy qz qw tx ty tz, got {str(poses[number])[:80]}"
            ) from error
        T_world_camera = pose_of_numbers(np.array([x, y, z, qx, qy, qz, qw]))
        if T_world_camera is not None:
            moments.append(odometry_moment(T_world_camera @ OPTICAL, stamp_ns))
    return moments, passed_over(len(numbers) - len(moments), len(numbers), "metadata") if poses else []


def _first_colour(source: Record3dFiles, names: list[str]) -> Size:
    pixels = decode_picture(source.read(names[0]), f"{source.path}/{names[0]}", COLOUR)
    return pixels.shape[1], pixels.shape[0]


def _first_depth(source: Record3dFiles, known: Mapping[str, Any], names: list[str]) -> Size:
    metres = _metres(source, known, names[0])
    return metres.shape[1], metres.shape[0]


def _metres(source: Record3dFiles, known: Mapping[str, Any], name: str) -> Array:
    return metres_of(source.read(name), name, f"{source.path}/{name}", known)


def _colour_message(source: Record3dFiles, name: str, stamp_ns: int, size: Size) -> Any:
    pixels = decode_picture(source.read(name), f"{source.path}/{name}", COLOUR)
    rgb = cv2.cvtColor(brought_to(pixels, size), cv2.COLOR_BGR2RGB)
    return messages.image(np.asarray(rgb), "rgb8", stamp_ns, CAMERA_FRAME)


def _depth_message(source: Record3dFiles, known: Mapping[str, Any], name: str, stamp_ns: int) -> Any:
    return messages.image(_metres(source, known, name), "32FC1", stamp_ns, CAMERA_FRAME)
