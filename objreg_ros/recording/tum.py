# SPDX-License-Identifier: Apache-2.0
"""Folders in the TUM RGB-D layout, as a recording of standard messages.

``rgb/`` and ``depth/`` (16-bit PNG registered to colour), ``associations.txt`` or ``rgb.txt`` and ``depth.txt``,
``groundtruth.txt`` (timestamp tx ty tz qx qy qz qw of the colour camera in the world), ``accelerometer.txt``
(timestamp ax ay az in m/s^2, in axes of its own that the benchmark does not tell) and ``camera.yaml`` (see
`tum_camera`), which may all be missing. See Sturm et al., "A Benchmark for the Evaluation of RGB-D SLAM Systems"
(2012).
"""

from __future__ import annotations

import stat
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import suppress
from decimal import Decimal
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from objreg_ros import limits
from objreg_ros.bridge.pictures import require_picture
from objreg_ros.geometry import is_rigid, pose, rotation_from_quaternion
from objreg_ros.recording import messages
from objreg_ros.recording.poses import passed_over
from objreg_ros.recording.record import Record, Recording, Topic
from objreg_ros.recording.text import read_text, require_regular
from objreg_ros.recording.tum_camera import TumCamera, read_camera

Array = NDArray[Any]

IMAGE, DEPTH, CAMERA_INFO, GROUND_TRUTH, IMU = "/image", "/depth/image", "/camera_info", "/ground_truth", "/imu"
TYPES = {
    CAMERA_INFO: "sensor_msgs/msg/CameraInfo",
    GROUND_TRUTH: "geometry_msgs/msg/PoseStamped",
    IMU: "sensor_msgs/msg/Imu",
    IMAGE: "sensor_msgs/msg/Image",
    DEPTH: "sensor_msgs/msg/Image",
}
CAMERA_FRAME, WORLD_FRAME, IMU_FRAME = "camera", "world", "accelerometer"
ASSOCIATION_NS = 20_000_000  # as the benchmark's associate.py
AROUND_NS = 500_000_000  # what the accelerometer felt before and after all pictures is left out
NS_DIGITS = 19
MOST_NAMED = 5  # files in a note
END_OF_TIME_S = 2**31  # what the stamp of a message holds, until 2038
MILLIMETRES = 1000.0
COLOUR = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION  # depth is not turned either
PICTURES = ("PNG", "JPEG", "BMP", "TIFF", "PPM", "WEBP")  # as Pillow calls what OpenCV reads of
PICTURE_FILES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm", ".ppm", ".webp")

Picture = tuple[int, str]  # stamp, file
Pair = tuple[int, str, int, str]  # colour stamp, colour file, depth stamp, depth file


class Moment(NamedTuple):
    """One record before it is made."""

    stamp_ns: int
    topic: str
    make: Callable[[], Any]


class TumRecording(Recording):
    """A TUM RGB-D folder; its topics are those of the graph and ``/ground_truth``. It never has odometry."""

    kind = "TUM RGB-D folder"

    def __init__(self, path: Path) -> None:
        self.path = path
        pairs, self.notes = _pairs(path)
        self._camera = self._read_camera(list(dict.fromkeys(colour for _, colour, _, _ in pairs)))
        moments = [m for pair in pairs for m in self._moments(*pair)] + self._ground_truth()
        first_ns, last_ns = min(m.stamp_ns for m in moments), max(m.stamp_ns for m in moments)
        moments += _accelerations(path / "accelerometer.txt", first_ns - AROUND_NS, last_ns + AROUND_NS)
        order = list(TYPES)
        self._sequence = sorted(moments, key=lambda m: (m.stamp_ns, order.index(m.topic)))
        counts = {name: sum(m.topic == name for m in moments) for name in TYPES}
        self.topics = {name: Topic(name, TYPES[name], count) for name, count in counts.items() if count}
        self.start_ns, self.end_ns = self._sequence[0].stamp_ns, self._sequence[-1].stamp_ns + 1

    def records(
        self, topics: Collection[str] | None = None, start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[Record]:
        """See `Recording.records`. The message of a picture that does not decode is a ValueError."""
        for stamp_ns, topic, make in self._sequence:
            wanted = topics is None or topic in topics
            if wanted and (start_ns is None or stamp_ns >= start_ns) and (end_ns is None or stamp_ns < end_ns):
                yield Record.made(topic, TYPES[topic], stamp_ns, make)

    def _moments(self, colour_ns: int, colour: str, depth_ns: int, depth: str) -> list[Moment]:
        camera = self._camera
        info = partial(messages.camera_info, camera.intrinsics, depth_ns, CAMERA_FRAME, camera.distortion)
        return [
            Moment(depth_ns, CAMERA_INFO, info),
            Moment(colour_ns, IMAGE, partial(_colour_message, self.path, colour, colour_ns)),
            Moment(depth_ns, DEPTH, partial(_depth_message, self.path, depth, depth_ns, camera.depth_scale)),
        ]

    def _read_camera(self, pictures: Sequence[str]) -> TumCamera:
        height, width = _first_size(self.path, pictures)
        camera = read_camera(self.path / "camera.yaml", width, height)
        self.notes += camera.notes
        return camera

    def _ground_truth(self) -> list[Moment]:
        file = self.path / "groundtruth.txt"
        told = [_true_moment(row, file) for row in _rows(file, 8)] if file.exists() else []
        moments = [moment for moment in told if moment is not None]
        self.notes += passed_over(len(told) - len(moments), len(told), file.name)
        return moments


def _pairs(folder: Path) -> tuple[list[Pair], list[str]]:
    """Every associated pair, and a note for the user on the pictures that have no partner."""
    names = ("associations.txt", "associate.txt", "association.txt", "assoc.txt")
    file = next((folder / name for name in names if (folder / name).exists()), None)
    if file is not None:
        pairs, notes = [(_stamp(row[0], file), row[1], _stamp(row[2], file), row[3]) for row in _rows(file, 4)], []
    else:
        colour, depth = _pictures(folder, "rgb"), _pictures(folder, "depth")
        pairs = _associate(colour, depth)
        notes = _unpaired(len(pairs), len(colour), len(depth)) + _strangers(folder)
    _require_pictures(folder, dict.fromkeys(name for _, c, _, d in pairs for name in (c, d)))
    if not pairs:
        raise FileNotFoundError(f"{folder}: expected colour and depth pictures within 20 ms of each other, got none")
    return pairs, notes


def _require_pictures(folder: Path, names: Iterable[str]) -> None:
    """FileNotFoundError where a picture is missing; ValueError where one lies outside of the folder or is no file."""
    real = cache(partial(Path.resolve, strict=True))  # of the folders, which are few
    for name in names:
        file = folder / name
        try:
            kind = file.lstat().st_mode
            place = real(file) if stat.S_ISLNK(kind) or file.name == ".." else real(file.parent) / file.name
            inside = place.is_relative_to(real(folder))
        except (FileNotFoundError, NotADirectoryError, RuntimeError) as error:  # a loop of links is a RuntimeError
            told = f"expected the picture {name} that its list names, got no such file"
            raise FileNotFoundError(f"{folder}: {told}") from error
        if not inside:
            raise ValueError(f"{folder}: expected pictures inside of this folder, got {name} at {place}; copy it there")
        if not stat.S_ISREG(kind):
            require_regular(file)


def _unpaired(pairs: int, colour: int, depth: int) -> list[str]:
    if colour == depth == pairs:
        return []
    alone = f"{colour - pairs} of {colour} colour and {depth - pairs} of {depth} depth pictures"
    return [f"{alone} have no partner within 20 ms and are left out"]


def _pictures(folder: Path, name: str) -> list[Picture]:
    """The pictures of a list like rgb.txt, or those of the folder itself where they are named by time."""
    file = folder / f"{name}.txt"
    if file.exists():
        return [(_stamp(row[0], file), row[1]) for row in _rows(file, 2)]
    pictures = [file for file in _files(folder, name) if _is_picture(file)]
    return [(_stamp(picture.stem, picture), f"{name}/{picture.name}") for picture in pictures]


def _files(folder: Path, name: str) -> list[Path]:
    """What is in the folder of pictures, where no list says it."""
    here = folder / name
    return sorted(here.iterdir()) if here.is_dir() and not here.with_suffix(".txt").exists() else []


def _is_picture(file: Path) -> bool:
    return file.suffix.lower() in PICTURE_FILES and not file.name.startswith(".")


def _strangers(folder: Path) -> list[str]:
    """A note for the user on files among the pictures that are none."""
    names = [
        f"{name}/{file.name}" for name in ("rgb", "depth") for file in _files(folder, name) if not _is_picture(file)
    ]
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return [f"no pictures, and left out: {', '.join(names[:MOST_NAMED])}{more}"] if names else []


def _associate(colour: list[Picture], depth: list[Picture]) -> list[Pair]:
    """Each colour picture with the depth picture nearest in time, each used once, best pairs first."""
    colour, depth = sorted(colour), sorted(depth)  # the names of files and the lines of lists may be in any order
    depth_ns = np.array([stamp for stamp, _ in depth], np.int64)
    near = [(abs(stamp - int(d)), i, j) for i, (stamp, _) in enumerate(colour) for j, d in _around(depth_ns, stamp)]
    pairs: dict[int, int] = {}
    taken: set[int] = set()
    for _, i, j in sorted(n for n in near if n[0] <= ASSOCIATION_NS):
        if i not in pairs and j not in taken:
            pairs[i] = j
            taken.add(j)
    return [(*colour[i], *depth[j]) for i, j in sorted(pairs.items())]


def _around(stamps: Array, stamp: int) -> list[tuple[int, int]]:
    place = int(np.searchsorted(stamps, stamp))
    return [(j, int(stamps[j])) for j in (place - 1, place) if 0 <= j < len(stamps)]


def _accelerations(file: Path, first_ns: int, last_ns: int) -> list[Moment]:
    """The rows of an accelerometer within a time; none where there is no such file."""
    told = [_acceleration(row, file) for row in _rows(file, 4)] if file.exists() else []
    return [moment for moment in told if first_ns <= moment.stamp_ns <= last_ns]


def _acceleration(row: list[str], file: Path) -> Moment:
    try:
        numbers = [float(text) for text in row[1:4]]
    except ValueError as error:
        raise ValueError(f"{file}: expected timestamp ax ay az, got {' '.join(row)}") from error
    stamp_ns = _stamp(row[0], file)
    return Moment(stamp_ns, IMU, partial(messages.imu, numbers, None, stamp_ns, IMU_FRAME))


def _true_moment(row: list[str], file: Path) -> Moment | None:
    """A row of the ground truth; None where its numbers are no pose. ValueError where they are no numbers."""
    try:
        numbers = np.array([float(text) for text in row[1:8]])
    except ValueError as error:
        raise ValueError(f"{file}: expected timestamp tx ty tz qx qy qz qw, got {' '.join(row)}") from error
    stamp_ns, T_world_camera = _stamp(row[0], file), _true_pose(numbers)
    if T_world_camera is None:
        return None
    return Moment(stamp_ns, GROUND_TRUTH, partial(messages.pose_stamped, T_world_camera, stamp_ns, WORLD_FRAME))


def _true_pose(numbers: Array) -> Array | None:
    """``T_world_camera`` of tx ty tz qx qy qz qw; None where they are no pose."""
    try:
        T_world_camera = pose(rotation_from_quaternion(numbers[3:]), numbers[:3])
    except ValueError:
        return None
    return T_world_camera if is_rigid(T_world_camera) else None


def _rows(file: Path, columns: int) -> list[list[str]]:
    told = (line.strip() for line in read_text(file).splitlines())
    lines = [line.split() for line in told if line and not line.startswith("#")]
    short = next((line for line in lines if len(line) < columns), None)
    if short is not None:
        raise ValueError(f"{file}: expected {columns} columns in each line, got {' '.join(short)!r}")
    return lines


def _stamp(text: str, file: Path) -> int:
    """Nanoseconds of a time in seconds, or of 19 digits that are nanoseconds already: those of 2001 and later."""
    is_ns = len(text) == NS_DIGITS and text.isdecimal()
    try:
        seconds = Decimal(text) / (10**9 if is_ns else 1)
        if abs(seconds) < END_OF_TIME_S:
            return int((seconds * 10**9).to_integral_value())
    except ArithmeticError:  # no number, or none that can be compared
        pass
    raise ValueError(f"{file}: expected a time in seconds (or 19 digits of nanoseconds), got {text!r}")


def _first_size(folder: Path, names: Sequence[str]) -> tuple[int, ...]:
    """Height and width of the first picture that decodes; ValueError where none does."""
    for name in names:
        with suppress(ValueError):
            return _read_picture(folder / name, COLOUR).shape[:2]
    raise ValueError(
        f"{folder / names[0]}: expected a picture, got {len(names)} that do not decode; check the download"
    )


def _read_picture(file: Path, flags: int) -> Array:
    require_regular(file)
    data = file.read_bytes()
    try:
        require_picture(data, PICTURES, limits.MOST_PIXELS_OF_PICTURE)
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except ValueError as error:
        raise ValueError(f"{file}: expected a picture, got a refusal: {error}; check the download") from error
    except (cv2.error, MemoryError) as error:
        said = " ".join(str(error).split())
        raise ValueError(f"{file}: expected a picture, got what OpenCV refuses: {said}; check the download") from error
    if pixels is None:
        raise ValueError(f"{file}: expected a picture, got a file that does not decode; check the download")
    return np.asarray(pixels)


def _colour_message(folder: Path, name: str, stamp_ns: int) -> Any:
    rgb = cv2.cvtColor(_read_picture(folder / name, COLOUR), cv2.COLOR_BGR2RGB)
    return messages.image(rgb, "rgb8", stamp_ns, CAMERA_FRAME)


def _depth_message(folder: Path, name: str, stamp_ns: int, scale: float) -> Any:
    """16UC1 where the steps are millimetres, else 32FC1 metres."""
    pixels = _read_picture(folder / name, cv2.IMREAD_UNCHANGED)
    if pixels.dtype != np.uint16 or pixels.ndim != 2:
        raise ValueError(
            f"{folder / name}: expected a 16-bit picture of one channel, got {pixels.dtype} {pixels.shape}"
        )
    if scale == MILLIMETRES:
        return messages.image(pixels, "16UC1", stamp_ns, CAMERA_FRAME)
    metres = np.where(pixels == np.iinfo(np.uint16).max, np.float32(0), pixels / np.float32(scale)).astype(np.float32)
    return messages.image(metres, "32FC1", stamp_ns, CAMERA_FRAME)
