# SPDX-License-Identifier: Apache-2.0
"""Folders as the app Stray Scanner exports a scan of an iPhone or iPad.

``rgb.mp4``, ``depth/N.png`` in millimetres, ``odometry.csv`` with a row for each frame of the video and
``camera_matrix.csv`` of the video, which has more pixels than depth. The poses are ARKit's own odometry; the app turns
them into the optical frame (x right, y down, z forward) as it writes them.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from objreg_ros import limits
from objreg_ros.bridge.camera.calibration import of_file
from objreg_ros.bridge.camera.calibration_files import parse_camera
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
    MILLIMETRES,
    Size,
    brought_to,
    depth_message,
    first_depth_size,
    is_picture,
    larger_colour,
    require_pictures,
)
from objreg_tools.recording.folders.scannet import scaled_camera
from objreg_tools.recording.folders.text import SETTINGS_BYTES, read_text, require_regular
from objreg_tools.recording.folders.tum_lists import Table, pose_columns, read_table, stamp_of
from objreg_tools.recording.poses import passed_over
from objreg_tools.recording.rosbag import messages

VIDEO, DEPTHS, POSES, CAMERA = "rgb.mp4", "depth", "odometry.csv", "camera_matrix.csv"
COLUMNS = ("timestamp", "frame", "x", "y", "z", "qx", "qy", "qz", "qw")
NEAR = 100  # frames that are passed over one by one: to seek goes to a key frame and decodes from there


class StrayRecording(FolderRecording):
    """A scan of Stray Scanner; its topics are those of the graph, with ``/odom`` as ARKit measured it."""

    kind = "Stray Scanner folder"

    def __init__(self, path: Path) -> None:
        _require_parts(path)
        table = read_table(path / POSES, len(COLUMNS))
        depths = _depths(path)
        rows = [row for row in table.rows if _frame(row, path) in depths]
        if not rows:
            got = f"{len(table.rows)} rows and {len(depths)} pictures"
            raise ValueError(f"{path}: expected rows of {POSES} with pictures of their frames in {DEPTHS}/, got {got}")
        self._video = Video(path / VIDEO)
        depth = first_depth_size(path, [depths[_frame(row, path)] for row in rows]) or self._video.size
        known = of_file(parse_camera(read_text(path / CAMERA, SETTINGS_BYTES)))
        camera, notes = scaled_camera(known, self._video.size, depth, MILLIMETRES, CAMERA)
        moments, of_poses = _odometry(rows, table, path)
        for row in rows:
            stamp_ns, frame = stamp_of(row[0], path / POSES), _frame(row, path)
            colour = partial(self._video.message, frame, stamp_ns, camera.size)
            picture = partial(depth_message, path / depths[frame], stamp_ns, CAMERA_FRAME, MILLIMETRES)
            moments += [
                info_moment(camera, stamp_ns),
                FrameFiles(stamp_ns, IMAGE, colour),
                FrameFiles(stamp_ns, DEPTH, picture),
            ]
        alone = len(table.rows) + len(depths) - 2 * len(rows)
        left = [f"{alone} frames have no depth or no pose and are left out"] if alone else []
        super().__init__(path, moments, [*notes, *larger_colour(self._video.size, depth), *left, *of_poses])

    def close(self) -> None:
        """Close the video."""
        self._video.close()


class Video:
    """A video whose frames are asked for by number, mostly one after the other. ValueError for what is no video."""

    def __init__(self, file: Path) -> None:
        require_regular(file)
        self._file, self._next = file, 0
        self._capture = cv2.VideoCapture(str(file))
        self._capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)  # depth is not turned either
        width, height = (int(self._capture.get(p)) for p in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT))
        if not self._capture.isOpened() or not 0 < width * height <= limits.MOST_PIXELS_OF_PICTURE:
            got = f"{width} × {height} pixels" if self._capture.isOpened() else "a file that OpenCV does not open"
            raise ValueError(f"{file}: expected a video, got {got}; export the scan again")
        self.size: Size = width, height

    def frame(self, number: int) -> Array:
        """The picture (H, W, 3) BGR of a number from 0; ValueError where it does not decode."""
        if not 0 <= number - self._next <= NEAR:
            self._capture.set(cv2.CAP_PROP_POS_FRAMES, number)
            self._next = number
        while self._next < number and self._capture.grab():
            self._next += 1
        decoded, pixels = self._capture.read()
        self._next += 1
        if not decoded or self._next != number + 1:
            self._next = -NEAR - 1  # the place in the video is not known any more
            raise ValueError(f"{self._file}: expected frame {number}, got a video that ends or breaks before it")
        return np.asarray(pixels)

    def message(self, number: int, stamp_ns: int, size: Size) -> Any:
        """sensor_msgs/Image of a frame, brought to ``size`` where it is larger."""
        rgb = cv2.cvtColor(brought_to(self.frame(number), size), cv2.COLOR_BGR2RGB)
        return messages.image(np.asarray(rgb), "rgb8", stamp_ns, CAMERA_FRAME)

    def close(self) -> None:
        """Let go of the file."""
        self._capture.release()


def is_stray(folder: Path) -> bool:
    """Whether a folder has what a scan has, though a part may be missing."""
    return (folder / POSES).is_file() and ((folder / CAMERA).exists() or (folder / VIDEO).exists())


def _require_parts(folder: Path) -> None:
    missing = [name for name in (VIDEO, DEPTHS, POSES, CAMERA) if not (folder / name).exists()]
    if missing:
        got = ", ".join(sorted(file.name for file in folder.iterdir())[:8])
        raise FileNotFoundError(
            f"{folder}: expected {VIDEO}, {DEPTHS}/, {POSES} and {CAMERA} of a scan of Stray Scanner, got {got}, "
            f"without {', '.join(missing)}; copy the whole scan from the device"
        )


def _depths(folder: Path) -> dict[int, str]:
    """The depth pictures by the number of their frame."""
    files = [file for file in sorted((folder / DEPTHS).iterdir()) if is_picture(file) and file.stem.isdecimal()]
    names = {int(file.stem): f"{DEPTHS}/{file.name}" for file in files}
    require_pictures(folder, names.values())
    return names


def _frame(row: list[str], folder: Path) -> int:
    if not row[1].isdecimal():
        raise ValueError(f"{folder / POSES}: expected {', '.join(COLUMNS)}, got {' '.join(row)}")
    return int(row[1])


def _odometry(rows: list[list[str]], table: Table, folder: Path) -> tuple[list[FrameFiles], list[str]]:
    """The poses of the camera, and a note on rows that are none."""
    columns = pose_columns(table.names or COLUMNS)
    moments: list[FrameFiles] = []
    for row in rows:
        try:
            T_world_camera = pose_of_numbers(np.array([float(row[k]) for k in columns]))
        except ValueError as error:
            raise ValueError(f"{folder / POSES}: expected {', '.join(COLUMNS)}, got {' '.join(row)}") from error
        if T_world_camera is not None:
            moments.append(odometry_moment(T_world_camera, stamp_of(row[0], folder / POSES)))
    return moments, passed_over(len(rows) - len(moments), len(rows), POSES)
