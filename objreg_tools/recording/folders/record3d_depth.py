# SPDX-License-Identifier: Apache-2.0
"""The depth of one frame of Record3D: Apple's LZFSE, numpy, OpenEXR, or PNG in millimetres."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from io import BytesIO
from typing import Any

import cv2
import numpy as np

from objreg_ros import limits
from objreg_ros.data.checked import Array
from objreg_tools.recording.folders.picture_files import MILLIMETRES, decode_picture

DECODERS = ("liblzfse", "lzfse")  # of LZFSE, where one is installed
NO_LZFSE = (
    "expected depth that can be unpacked, got Apple's LZFSE, and no library for it is installed; `pip install "
    "pyliblzfse`, or export 16-bit PNG or .npy depth instead"
)


def metres_of(data: bytes, name: str, where: str, known: Mapping[str, Any]) -> Array:
    """Depth (H, W) float32 m of a file's bytes, 0 where there is none; ``where`` names it in a refusal.

    ``known`` are the metadata, which may say its size (``dw``, ``dh``). ValueError for what cannot be unpacked.
    """
    end = name.rpartition(".")[2].lower()
    if end == "depth":
        pixels = _shaped(np.frombuffer(_unpacked(data, where), np.float32), known, where)
    elif end == "npy":
        pixels = _of_npy(data, where)
    else:
        pixels = decode_picture(data, where, cv2.IMREAD_UNCHANGED) if end == "png" else _of_exr(data, where)
    if pixels.ndim == 3:
        pixels = pixels[..., 0]
    metres = pixels / np.float32(MILLIMETRES) if pixels.dtype == np.uint16 else pixels.astype(np.float32)
    return np.nan_to_num(metres, nan=0.0, posinf=0.0, neginf=0.0).astype(np.float32)


def _unpacked(data: bytes, where: str) -> bytes:
    decompress = _lzfse()
    if decompress is None:
        raise ValueError(f"{where}: {NO_LZFSE}")
    size = int.from_bytes(data[4:8], "little")  # of its first block
    if size > 4 * limits.MOST_PIXELS_OF_PICTURE:
        raise ValueError(f"{where}: expected depth of a picture, got a block of {size} bytes")
    try:
        return bytes(decompress(data))
    except Exception as error:  # the libraries of LZFSE have errors of their own
        raise ValueError(f"{where}: expected LZFSE, got: {error}; export it again") from error


def _lzfse() -> Callable[[bytes], bytes] | None:
    """The function that unpacks LZFSE; None where no library for it is installed."""
    for name in DECODERS:
        try:
            return import_module(name).decompress  # type: ignore[no-any-return]
        except (ImportError, AttributeError):
            continue
    return None


def _shaped(values: Array, known: Mapping[str, Any], where: str) -> Array:
    """Depth as rows, in the size that the metadata say, or in that of the shape of colour."""
    width, height = known.get("dw"), known.get("dh")
    if not isinstance(width, int) or not isinstance(height, int):
        w, h = float(known.get("w") or 3), float(known.get("h") or 4)
        width = round((len(values) * w / h) ** 0.5)
        height = len(values) // max(width, 1)
    if width * height != len(values) or not 0 < len(values) <= limits.MOST_PIXELS_OF_PICTURE:
        raise ValueError(f"{where}: expected depth of {width} × {height} pixels, got {len(values)}; export it again")
    return values.reshape(height, width)


def _of_npy(data: bytes, where: str) -> Array:
    try:
        return np.asarray(np.load(BytesIO(data), allow_pickle=False))
    except (ValueError, EOFError, OSError, MemoryError) as error:
        raise ValueError(f"{where}: expected an array of numpy, got: {error}; export it again") from error


def _of_exr(data: bytes, where: str) -> Array:
    try:
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        pixels = None
    if pixels is None:
        raise ValueError(
            f"{where}: expected depth that OpenCV reads, got OpenEXR, which this build of it does not; export the "
            "recording as .r3d, or its depth as 16-bit PNG or .npy"
        )
    return np.asarray(pixels)
