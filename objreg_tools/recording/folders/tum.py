# SPDX-License-Identifier: Apache-2.0
"""Folders in the TUM RGB-D layout, as a recording of standard messages.

``rgb/`` and ``depth/`` (16-bit PNG registered to colour), ``associations.txt`` (colour or depth first) or ``rgb.txt``
and ``depth.txt``,
``groundtruth.txt`` (timestamp tx ty tz qx qy qz qw of the colour camera in the world), ``accelerometer.txt``
(timestamp ax ay az in m/s^2, in axes of its own that the benchmark does not define) and ``camera.yaml`` (see
`tum_camera`), which may all be missing. See Sturm et al., "A Benchmark for the Evaluation of RGB-D SLAM Systems"
(2012).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from objreg_ros.data.checked import Array
from objreg_tools.recording.folders.folder import (
    IMU,
    NUMBERED,
    FolderRecording,
    FrameFiles,
    Pair,
    made_of_pairs,
    moments_of_pairs,
    pose_of_numbers,
    true_moment,
)
from objreg_tools.recording.folders.picture_files import (
    first_depth_size,
    first_size,
    is_depth,
    is_picture,
    larger_colour,
    require_pictures,
    same_shape,
)
from objreg_tools.recording.folders.tum_camera import TumCamera, camera_file, read_camera
from objreg_tools.recording.folders.tum_lists import are_frame_numbers, pose_columns, read_table, stamp_of
from objreg_tools.recording.poses import passed_over
from objreg_tools.recording.rosbag import messages

IMU_FRAME = "accelerometer"
ASSOCIATION_NS = 20_000_000  # as the benchmark's associate.py
AROUND_NS = 500_000_000  # samples of the accelerometer farther from all pictures than this are left out
MOST_NAMED = 5  # files in a note
ASSOCIATIONS = ("associations.txt", "associate.txt", "association.txt", "assoc.txt")

Named = tuple[str, str]  # the text of a stamp, file
Picture = tuple[int, str]  # stamp, file


class Pairs(NamedTuple):
    """The pairs of a folder, notes on them for the user, and whether their stamps were numbers of frames."""

    pairs: list[Pair]
    notes: list[str]
    frame_numbers: bool


class TumRecording(FolderRecording):
    """A TUM RGB-D folder; its topics are those of the graph and ``/ground_truth``. It never has odometry."""

    kind = "TUM RGB-D folder"

    def __init__(self, path: Path) -> None:
        pairs, notes, frame_numbers = _pairs(path)
        camera, of_camera = camera_of_pairs(path, pairs)
        truth, of_truth = _ground_truth(path / "groundtruth.txt", frame_numbers)
        moments = moments_of_pairs(path, pairs, camera) + truth
        first_ns, last_ns = min(m.stamp_ns for m in moments), max(m.stamp_ns for m in moments)
        moments += _accelerations(path / "accelerometer.txt", first_ns - AROUND_NS, last_ns + AROUND_NS)
        file = camera_file(path)
        made_of = made_of_pairs(pairs, camera, file.name if file.exists() else f"no {file.name}: the default camera")
        super().__init__(path, moments, [*notes, *of_camera, *of_truth], made_of)


def camera_of_pairs(folder: Path, pairs: Sequence[Pair]) -> tuple[TumCamera, list[str]]:
    """The camera of the depth pictures, and notes on it and on colour that is larger."""
    colour = first_size(folder, list(dict.fromkeys(name for _, name, _, _ in pairs)))
    depth = first_depth_size(folder, list(dict.fromkeys(name for _, _, _, name in pairs))) or colour
    camera = read_camera(camera_file(folder), *depth, colour if same_shape(colour, depth) else depth)
    return camera, [*camera.notes, *larger_colour(colour, depth)]


def _pairs(folder: Path) -> Pairs:
    """Every associated pair, and notes for the user on what was assumed and on pictures that have no partner."""
    file = next((folder / name for name in ASSOCIATIONS if (folder / name).exists()), None)
    pairs, notes, frame_numbers = _listed(folder, file) if file is not None else _by_time(folder)
    require_pictures(folder, dict.fromkeys(name for _, c, _, d in pairs for name in (c, d)))
    if not pairs:
        raise FileNotFoundError(f"{folder}: expected colour and depth pictures within 20 ms of each other, got none")
    if frame_numbers:
        notes.append(NUMBERED)
    return Pairs(pairs, notes, frame_numbers)


def _listed(folder: Path, file: Path) -> Pairs:
    """The pairs of a list, in whose first columns may be depth."""
    rows = read_table(file, 4).rows
    numbers = are_frame_numbers(row[k] for row in rows for k in (0, 2)) and len(rows) > 1
    pairs = [(stamp_of(r[0], file), r[1], stamp_of(r[2], file), r[3]) for r in rows]
    require_pictures(folder, dict.fromkeys(name for _, a, _, b in pairs for name in (a, b)))
    if not _is_depth_first(folder, pairs):
        return Pairs(pairs, [], numbers)
    turned = [(colour_ns, colour, depth_ns, depth) for depth_ns, depth, colour_ns, colour in pairs]
    return Pairs(turned, [f"{file.name} has depth in its first columns"], numbers)


def _is_depth_first(folder: Path, pairs: Sequence[Pair]) -> bool:
    """Whether the first file of a pair is depth and the second is not, by the first pair where the two differ."""
    for _, first, _, second in pairs:
        kinds = is_depth(folder / first), is_depth(folder / second)
        if kinds[0] != kinds[1]:
            return kinds[0]
    return False


def _by_time(folder: Path) -> Pairs:
    """The pairs of pictures whose times are near each other."""
    colour, depth = _pictures(folder, "rgb"), _pictures(folder, "depth")
    stamps = [text for text, _ in (*colour, *depth)]
    numbers = are_frame_numbers(stamps) and len(stamps) > 2
    at = {text: stamp_of(text, folder) for text in stamps}
    pairs = _associate([(at[text], name) for text, name in colour], [(at[text], name) for text, name in depth])
    return Pairs(pairs, _unpaired(len(pairs), len(colour), len(depth)) + _strangers(folder), numbers)


def _unpaired(pairs: int, colour: int, depth: int) -> list[str]:
    if colour == depth == pairs:
        return []
    alone = f"{colour - pairs} of {colour} colour and {depth - pairs} of {depth} depth pictures"
    return [f"{alone} have no partner within 20 ms and are left out"]


def _pictures(folder: Path, name: str) -> list[Named]:
    """The pictures of a list like rgb.txt, or those of the folder itself where they are named by time."""
    file = folder / f"{name}.txt"
    if file.exists():
        return [(row[0], row[1]) for row in read_table(file, 2).rows]
    return [(picture.stem, f"{name}/{picture.name}") for picture in _files(folder, name) if is_picture(picture)]


def _files(folder: Path, name: str) -> list[Path]:
    """The files in the folder of pictures, where there is no list."""
    here = folder / name
    return sorted(here.iterdir()) if here.is_dir() and not here.with_suffix(".txt").exists() else []


def _strangers(folder: Path) -> list[str]:
    """A note for the user on files among the pictures that are none."""
    names = [
        f"{name}/{file.name}" for name in ("rgb", "depth") for file in _files(folder, name) if not is_picture(file)
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


def _accelerations(file: Path, first_ns: int, last_ns: int) -> list[FrameFiles]:
    """The rows of an accelerometer within a time; none where there is no such file."""
    samples = [_acceleration(row, file) for row in read_table(file, 4).rows] if file.exists() else []
    return [sample for sample in samples if first_ns <= sample.stamp_ns <= last_ns]


def _acceleration(row: list[str], file: Path) -> FrameFiles:
    try:
        numbers = [float(text) for text in row[1:4]]
    except ValueError as error:
        raise ValueError(f"{file}: expected timestamp ax ay az, got {' '.join(row)}") from error
    stamp_ns = stamp_of(row[0], file)
    return FrameFiles(stamp_ns, IMU, partial(messages.imu, numbers, None, stamp_ns, IMU_FRAME))


def _ground_truth(file: Path, frame_numbers: bool) -> tuple[list[FrameFiles], list[str]]:
    """The poses of a file, none where there is no such file, and notes on it. ``frame_numbers`` is of the pictures."""
    if not file.exists():
        return [], []
    rows, names = read_table(file, 8)
    columns = pose_columns(names)
    poses = [_true_moment(row, columns, file) for row in rows]
    moments = [moment for moment in poses if moment is not None]
    notes = passed_over(len(poses) - len(moments), len(poses), file.name)
    if frame_numbers and rows and not are_frame_numbers(row[0] for row in rows):
        notes.append(f"{file.name} has other times than the pictures, which are the numbers of frames")
    return moments, notes


def _true_moment(row: list[str], columns: Sequence[int], file: Path) -> FrameFiles | None:
    """A row of the ground truth; None where its numbers are no pose. ValueError where they are no numbers."""
    try:
        numbers = np.array([float(row[k]) for k in columns])
    except ValueError as error:
        raise ValueError(f"{file}: expected timestamp tx ty tz qx qy qz qw, got {' '.join(row)}") from error
    T_world_camera = pose_of_numbers(numbers)
    stamp_ns = stamp_of(row[0], file)
    return None if T_world_camera is None else true_moment(T_world_camera, stamp_ns)
