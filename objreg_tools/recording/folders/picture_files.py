# SPDX-License-Identifier: Apache-2.0
"""Pictures that lie in folders: read within bounds, and as messages."""

from __future__ import annotations

import stat
from collections.abc import Iterable, Sequence
from contextlib import suppress
from functools import cache, partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from objreg_ros import limits
from objreg_ros.bridge.camera.calibration import SAME_SHAPE
from objreg_ros.bridge.messages.pictures import require_picture
from objreg_ros.data.checked import Array
from objreg_tools.recording.folders.text import require_regular
from objreg_tools.recording.rosbag import messages

MILLIMETRES = 1000.0
COLOUR = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION  # depth is not turned either
PICTURES = ("PNG", "JPEG", "BMP", "TIFF", "PPM", "WEBP")  # as Pillow calls what OpenCV reads of
PICTURE_FILES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm", ".ppm", ".webp")

Size = tuple[int, int]  # width, height


def is_picture(file: Path) -> bool:
    """Whether a file is a picture by its name."""
    return file.suffix.lower() in PICTURE_FILES and not file.name.startswith(".")


def require_pictures(folder: Path, names: Iterable[str]) -> None:
    """FileNotFoundError where a picture is missing; ValueError where one lies outside of the folder or is no file."""
    real = cache(partial(Path.resolve, strict=True))  # of the folders, which are few
    for name in names:
        file = folder / name
        try:
            kind = file.lstat().st_mode
            place = real(file) if stat.S_ISLNK(kind) or file.name == ".." else real(file.parent) / file.name
            inside = place.is_relative_to(real(folder))
        except (FileNotFoundError, NotADirectoryError, RuntimeError) as error:  # a loop of links is a RuntimeError
            known = f"expected the picture {name} that its list names, got no such file"
            raise FileNotFoundError(f"{folder}: {known}") from error
        if not inside:
            raise ValueError(f"{folder}: expected pictures inside of this folder, got {name} at {place}; copy it there")
        if not stat.S_ISREG(kind):
            require_regular(file)


def first_size(folder: Path, names: Sequence[str]) -> Size:
    """Width and height of the first colour picture that decodes; ValueError where none does."""
    for name in names:
        with suppress(ValueError):
            height, width = read_picture(folder / name, COLOUR).shape[:2]
            return width, height
    raise ValueError(
        f"{folder / names[0]}: expected a picture, got {len(names)} that do not decode; check the download"
    )


def first_depth_size(folder: Path, names: Sequence[str]) -> Size | None:
    """Width and height of the first depth picture that decodes; None where none does."""
    for name in names:
        with suppress(ValueError):
            height, width = read_picture(folder / name, cv2.IMREAD_UNCHANGED).shape[:2]
            return width, height
    return None


def is_depth(file: Path) -> bool:
    """Whether a picture is one of depth: 16 bits of one channel."""
    try:
        pixels = read_picture(file, cv2.IMREAD_UNCHANGED)
    except ValueError:
        return False
    return bool(pixels.dtype == np.uint16 and pixels.ndim == 2)


def same_shape(a: Size, b: Size) -> bool:
    """Whether two pictures show as much in width as in height, so that one may be the other with more pixels."""
    return abs(a[0] * b[1] / (a[1] * b[0]) - 1.0) <= SAME_SHAPE


def larger_colour(colour: Size, depth: Size) -> list[str]:
    """A note for the user where colour is brought to the size of depth."""
    if colour[0] <= depth[0] or not same_shape(colour, depth):
        return []
    sizes = f"colour has {colour[0]} × {colour[1]} pixels and depth {depth[0]} × {depth[1]}"
    return [f"{sizes}: colour is brought to the size of depth"]


def brought_to(rgb: Array, size: Size) -> Array:
    """A picture (H, W, 3) with the pixels of a smaller size; as it is where that is not smaller or of another shape."""
    had = rgb.shape[1], rgb.shape[0]
    if had == size or had[0] < size[0] or not same_shape(had, size):
        return rgb
    return np.asarray(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA))


def read_picture(file: Path, flags: int) -> Array:
    """The pixels of a picture as OpenCV gives them; ValueError for what does not decode, or is too large."""
    require_regular(file)
    return decode_picture(file.read_bytes(), str(file), flags)


def decode_picture(data: bytes, file: str, flags: int) -> Array:
    """As `read_picture`, of the bytes of a file."""
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


def colour_message(file: Path, stamp_ns: int, frame_id: str, size: Size) -> Any:
    """sensor_msgs/Image of a colour picture, brought to ``size`` where it is larger."""
    rgb = cv2.cvtColor(brought_to(read_picture(file, COLOUR), size), cv2.COLOR_BGR2RGB)
    return messages.image(np.asarray(rgb), "rgb8", stamp_ns, frame_id)


def depth_message(file: Path, stamp_ns: int, frame_id: str, scale: float) -> Any:
    """sensor_msgs/Image of a depth picture: 16UC1 where its steps are millimetres, else 32FC1 metres."""
    pixels = read_picture(file, cv2.IMREAD_UNCHANGED)
    if pixels.dtype != np.uint16 or pixels.ndim != 2:
        raise ValueError(f"{file}: expected a 16-bit picture of one channel, got {pixels.dtype} {pixels.shape}")
    if scale == MILLIMETRES:
        return messages.image(pixels, "16UC1", stamp_ns, frame_id)
    metres = np.where(pixels == np.iinfo(np.uint16).max, np.float32(0), pixels / np.float32(scale)).astype(np.float32)
    return messages.image(metres, "32FC1", stamp_ns, frame_id)
