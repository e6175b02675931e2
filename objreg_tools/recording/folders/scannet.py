# SPDX-License-Identifier: Apache-2.0
"""Folders as ScanNet's reader exports a scene: color/, depth/, pose/ and intrinsic/, numbered by frames.

``pose/N.txt`` is the camera in the world, 4 × 4, of BundleFusion: it counts as the truth. Depth is in millimetres and
registered to colour, which has more pixels. See Dai et al., "ScanNet" (2017).
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from objreg_ros.bridge.camera.calibration import Calibration, of_file
from objreg_ros.bridge.camera.calibration_files import parse_camera
from objreg_ros.data.checked import Array
from objreg_ros.data.images import Intrinsics
from objreg_ros.geometry import is_rigid, rigid
from objreg_tools.recording.folders.folder import (
    NUMBERED,
    FolderRecording,
    FrameFiles,
    Pair,
    made_of_pairs,
    moments_of_pairs,
    true_moment,
)
from objreg_tools.recording.folders.picture_files import (
    MILLIMETRES,
    Size,
    first_depth_size,
    first_size,
    is_picture,
    larger_colour,
    require_pictures,
)
from objreg_tools.recording.folders.text import SETTINGS_BYTES, read_text
from objreg_tools.recording.folders.tum_camera import TumCamera, scaled
from objreg_tools.recording.folders.tum_lists import stamp_of
from objreg_tools.recording.poses import passed_over

ROUNDED = 1e-3  # the error of a rotation that is rounded to a few digits
COLOUR, DEPTH, POSES, CAMERA = "color", "depth", "pose", "intrinsic"


class ScanNetRecording(FolderRecording):
    """A scene of ScanNet; its topics are those of the graph and ``/ground_truth``."""

    kind = "ScanNet folder"

    def __init__(self, path: Path) -> None:
        pairs, notes = numbered_pairs(path, COLOUR, DEPTH)
        colour, depth = sizes_of(path, pairs)
        camera, of_camera = _camera(path / CAMERA, colour, depth)
        truth, of_truth = _truth(path / POSES, {Path(name).stem for _, name, _, _ in pairs})
        moments = moments_of_pairs(path, pairs, camera) + truth
        remarks = [NUMBERED, *notes, *of_camera, *larger_colour(colour, depth), *of_truth]
        super().__init__(path, moments, remarks, made_of_pairs(pairs, camera, f"{CAMERA}/"))


def is_scannet(folder: Path) -> bool:
    """Whether a folder has what an exported scene has, though a part may be missing."""
    return sum((folder / name).is_dir() for name in (COLOUR, DEPTH, POSES, CAMERA)) >= 3


def numbered_pairs(folder: Path, colour: str, depth: str) -> tuple[list[Pair], list[str]]:
    """Colour and depth of the same number, and a note on those that are alone; FileNotFoundError where all are."""
    numbered = [_numbered(folder / name) for name in (colour, depth)]
    both = sorted(numbered[0].keys() & numbered[1].keys())
    if not both:
        got = f"{len(numbered[0])} and {len(numbered[1])} pictures and no pair"
        raise FileNotFoundError(f"{folder}: expected pictures of one number in {colour}/ and {depth}/, got {got}")
    pairs = [(s, f"{colour}/{numbered[0][n]}", s, f"{depth}/{numbered[1][n]}") for n in both for s in [_stamp(n)]]
    require_pictures(folder, (name for _, c, _, d in pairs for name in (c, d)))
    alone = sum(map(len, numbered)) - 2 * len(both)
    return pairs, [f"{alone} pictures have no partner of their number and are left out"] if alone else []


def sizes_of(folder: Path, pairs: Iterable[Pair]) -> tuple[Size, Size]:
    """Width and height of colour and of depth."""
    pairs = list(pairs)
    colour = first_size(folder, [name for _, name, _, _ in pairs])
    return colour, first_depth_size(folder, [name for _, _, _, name in pairs]) or colour


def scaled_camera(known: Calibration, of: Size, depth: Size, scale: float, what: str) -> tuple[TumCamera, list[str]]:
    """The camera of a file, of pictures of a size, for those of depth; a note where it is brought to another size."""
    width, height = (known.width, known.height) if known.width else of
    pinhole = Intrinsics(fx=known.k[0], fy=known.k[4], cx=known.k[2], cy=known.k[5], width=width, height=height)
    fitting = scaled(pinhole, *depth)
    said = f"{what} is of pictures of {width} × {height}: scaled to depth's {depth[0]} × {depth[1]}"
    return TumCamera(fitting, scale, (0.0,) * 5), [] if fitting is pinhole else [said]


def _numbered(folder: Path) -> dict[int, str]:
    """The names of the pictures of a folder by their numbers; those with another name are none."""
    files = sorted(folder.iterdir()) if folder.is_dir() else []
    return {int(file.stem): file.name for file in files if is_picture(file) and file.stem.isdecimal()}


def _stamp(number: int) -> int:
    return stamp_of(str(number), Path(COLOUR))


def _camera(folder: Path, colour: Size, depth: Size) -> tuple[TumCamera, list[str]]:
    """The camera of the depth pictures, or that of colour brought to their size."""
    for name, size in (("intrinsic_depth.txt", depth), ("intrinsic_color.txt", colour)):
        if (folder / name).exists():
            try:
                known = of_file(parse_camera(read_text(folder / name, SETTINGS_BYTES)))
                return scaled_camera(known, size, depth, MILLIMETRES, f"{CAMERA}/{name}")
            except ValueError as error:
                raise ValueError(f"{folder / name}: expected a matrix of 4 × 4, got: {error}") from error
    got = ", ".join(sorted(file.name for file in folder.glob("*"))[:5]) or "nothing"
    raise FileNotFoundError(f"{folder}: expected intrinsic_depth.txt or intrinsic_color.txt, got {got}")


def _truth(folder: Path, stems: set[str]) -> tuple[list[FrameFiles], list[str]]:
    """The poses of the frames, and a note on those that BundleFusion lost: it writes -inf."""
    files = sorted((file for file in folder.glob("*.txt") if file.stem in stems), key=lambda file: int(file.stem))
    known = [(int(file.stem), _pose(file)) for file in files]
    moments = [true_moment(T, _stamp(number)) for number, T in known if T is not None]
    return moments, passed_over(len(known) - len(moments), len(known), f"{POSES}/")


def _pose(file: Path) -> Array | None:
    """``T_world_camera`` of a file; None where it is no pose. ValueError where it has no 16 numbers."""
    text = read_text(file, SETTINGS_BYTES)
    try:
        T_world_camera = np.array([float(part) for part in text.replace(",", " ").split()]).reshape(4, 4)
    except ValueError as error:
        raise ValueError(f"{file}: expected 4 × 4 numbers, got {text[:80]!r}") from error
    return rigid(T_world_camera) if is_rigid(T_world_camera, ROUNDED) else None
