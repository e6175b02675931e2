# SPDX-License-Identifier: Apache-2.0
"""The pixels of Image and CompressedImage messages, raw and compressed, as colour or as depth.

How many there are is read off the message or off the header of its file, before any is decoded.
"""

from __future__ import annotations

import io
import re
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from objreg_ros import limits
from objreg_ros.bridge.messages import rvl

Array = NDArray[Any]

DEPTH_SCALE = 0.001  # metres of one step of 16UC1, REP-118
NO_DEPTH = 65535  # some drivers write it where they measured nothing

# encoding: (dtype, channels, OpenCV's conversion to RGB). OpenCV's plain 8UC3 and 8UC4 are BGR by its own convention.
# The names of Bayer's patterns are those of the first two rows, in ROS and in OpenCV's aliases alike; OpenCV's older
# names, like BayerBG for RGGB, begin elsewhere.
COLOUR: dict[str, tuple[str, int, int | None]] = {
    "rgb8": ("u1", 3, None),
    "bgr8": ("u1", 3, cv2.COLOR_BGR2RGB),
    "rgba8": ("u1", 4, cv2.COLOR_RGBA2RGB),
    "bgra8": ("u1", 4, cv2.COLOR_BGRA2RGB),
    "mono8": ("u1", 1, cv2.COLOR_GRAY2RGB),
    "mono16": ("u2", 1, cv2.COLOR_GRAY2RGB),
    "8UC1": ("u1", 1, cv2.COLOR_GRAY2RGB),
    "8UC3": ("u1", 3, cv2.COLOR_BGR2RGB),
    "8UC4": ("u1", 4, cv2.COLOR_BGRA2RGB),
    "rgb16": ("u2", 3, None),
    "bgr16": ("u2", 3, cv2.COLOR_BGR2RGB),
    "yuv422": ("u1", 2, cv2.COLOR_YUV2RGB_UYVY),
    "uyvy": ("u1", 2, cv2.COLOR_YUV2RGB_UYVY),
    "yuv422_yuy2": ("u1", 2, cv2.COLOR_YUV2RGB_YUY2),
    "yuyv": ("u1", 2, cv2.COLOR_YUV2RGB_YUY2),
    "bayer_rggb8": ("u1", 1, cv2.COLOR_BayerRGGB2RGB),
    "bayer_bggr8": ("u1", 1, cv2.COLOR_BayerBGGR2RGB),
    "bayer_gbrg8": ("u1", 1, cv2.COLOR_BayerGBRG2RGB),
    "bayer_grbg8": ("u1", 1, cv2.COLOR_BayerGRBG2RGB),
    "bayer_rggb16": ("u2", 1, cv2.COLOR_BayerRGGB2RGB),
    "bayer_bggr16": ("u2", 1, cv2.COLOR_BayerBGGR2RGB),
    "bayer_gbrg16": ("u2", 1, cv2.COLOR_BayerGBRG2RGB),
    "bayer_grbg16": ("u2", 1, cv2.COLOR_BayerGRBG2RGB),
}
# Brightness for every pixel, and behind all of it colour in pairs, in as many rows of as many bytes to one of
# brightness. encoding: (rows, bytes a pixel, OpenCV's conversion to RGB). NV24 has no conversion of its own.
PLANES: dict[str, tuple[float, int, int]] = {
    "nv12": (0.5, 1, cv2.COLOR_YUV2RGB_NV12),
    "nv21": (0.5, 1, cv2.COLOR_YUV2RGB_NV21),
    "nv24": (1.0, 2, cv2.COLOR_YUV2RGB_YUY2),
}
# Pixels across and down that share one colour: a picture is made of whole ones.
BLOCKS = {
    **dict.fromkeys(("yuv422", "uyvy", "yuv422_yuy2", "yuyv"), (2, 1)),
    **dict.fromkeys((name for name in COLOUR if name.startswith("bayer")), (2, 2)),
    **dict.fromkeys(("nv12", "nv21"), (2, 2)),
}
DEPTH = {"16UC1": "u2", "mono16": "u2", "32FC1": "f4"}
INSTANCES = {"mono8": "u1", "8UC1": "u1", "mono16": "u2", "16UC1": "u2"}
AS_STORED = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION  # depth knows nothing of how a jpeg is to be held
PNG, CHUNK = b"\x89PNG\r\n\x1a\n", 12  # how a png begins, and the bytes of a chunk beside its data
COMPRESSED_DEPTH_HEADER = 12  # compressed_depth_image_transport: an enum and two floats before the PNG or the RVL
RVL = re.compile(r"compressedDepth\s+rvl", re.IGNORECASE)  # in the format; PNG is not always named


def colour_pixels(message: Any, most_pixels: int = limits.MOST_PIXELS_OF_PICTURE) -> Array:
    """(H, W, 3) uint8 RGB of an Image or CompressedImage.

    ValueError for an encoding that is no colour, and for more than so many pixels.
    """
    if hasattr(message, "format"):
        require_picture(message.data, ("JPEG", "PNG"), most_pixels)
        return _decoded(message.data, AS_STORED, cv2.COLOR_BGR2RGB, "a jpeg or png")
    _require_whole_blocks(message)
    if message.encoding in PLANES:
        return _of_planes(message, most_pixels)
    if message.encoding not in COLOUR:
        raise ValueError(f"image: expected an encoding of {', '.join((*COLOUR, *PLANES))}, got {message.encoding!r}")
    dtype, channels, conversion = COLOUR[message.encoding]
    pixels = _pixels(message, dtype, channels, most_pixels)
    if dtype == "u2":
        pixels = (pixels >> 8).astype(np.uint8)
    return pixels.copy() if conversion is None else cv2.cvtColor(pixels, conversion)


def depth_metres(message: Any, most_pixels: int = limits.MOST_PIXELS_OF_PICTURE) -> Array:
    """(H, W) float32 metres, 0 where there is none, of a depth Image or a compressedDepth CompressedImage.

    ValueError for an encoding that is no depth, and for more than so many pixels.
    """
    if hasattr(message, "format"):
        return _compressed_depth(message, most_pixels)
    if message.encoding not in DEPTH:
        raise ValueError(f"depth: expected an encoding of {', '.join(DEPTH)}, got {message.encoding!r}")
    pixels = _pixels(message, DEPTH[message.encoding], 1, most_pixels)
    return _metres(pixels) if pixels.dtype == np.uint16 else _measured(pixels.astype(np.float32))


def instance_numbers(message: Any, most_pixels: int = limits.MOST_PIXELS_OF_PICTURE) -> Array:
    """(H, W) uint16 of an Image of masks: each pixel has the number of its instance, 0 is none's.

    ValueError for an encoding that is no mask's, and for more than so many pixels.
    """
    encoding = getattr(message, "encoding", getattr(message, "format", ""))
    if encoding not in INSTANCES:
        raise ValueError(f"masks: expected an encoding of {', '.join(INSTANCES)}, got {encoding!r}")
    return _pixels(message, INSTANCES[encoding], 1, most_pixels).astype(np.uint16)


def unpack_rgb(packed: Array) -> Array:
    """(..., 3) uint8 RGB of the 0xAARRGGBB integers of a cloud, in any byte order."""
    bgra = np.ascontiguousarray(packed, "<u4").view(np.uint8).reshape(-1, 1, 4)
    return cv2.cvtColor(bgra, cv2.COLOR_BGRA2RGB).reshape(*packed.shape, 3)


def size_of(message: Any) -> tuple[int, int]:
    """Width and height of an Image, a CompressedImage or a compressedDepth, before its pixels are decoded.

    ValueError where it is of no size, or does not begin as a picture. A cloud's are those of its rows and columns.
    """
    if not hasattr(message, "format"):
        width, height = int(message.width), int(message.height)
        if min(width, height) <= 0:
            raise ValueError(f"image: expected pixels, got {width} × {height}")
        return width, height
    if RVL.search(message.format):
        return _size_of_rvl(np.frombuffer(message.data, np.uint8)[COMPRESSED_DEPTH_HEADER:])
    data = bytes(message.data)
    return _size_in_file(data[COMPRESSED_DEPTH_HEADER:] if "compressedDepth" in message.format else data)


def _size_of_rvl(packed: Array) -> tuple[int, int]:
    width, height = rvl.size(packed)
    if min(width, height) <= 0:
        raise ValueError(f"compressed depth: expected pixels, got {width} × {height}")
    return width, height


def _size_in_file(
    data: Any, formats: tuple[str, ...] = ("JPEG", "PNG"), most_pixels: int = limits.MOST_PIXELS_OF_PICTURE
) -> tuple[int, int]:
    """Width and height by the header of a file; ValueError where it does not begin as one, or is beyond all measure."""
    wanted = " or ".join(name.lower() for name in formats)
    try:
        with Image.open(io.BytesIO(data), formats=formats) as picture:
            return picture.size
    except Image.DecompressionBombError as error:  # Pillow has a limit of its own, of some 180 megapixels
        raise ValueError(f"compressed image: expected at most {most_pixels} pixels, got more: {error}") from error
    except (OSError, SyntaxError, ValueError, EOFError) as error:
        got = f"{len(data)} bytes that do not begin so"
        raise ValueError(f"compressed image: expected {wanted}, got {got}") from error


def require_picture(data: Any, formats: tuple[str, ...], most_pixels: int) -> None:
    """ValueError unless ``data`` begins as a picture of one of Pillow's ``formats``, of at most so many pixels."""
    width, height = _size_in_file(data, formats, most_pixels)
    _require_size(width, height, most_pixels)
    if bytes(data[:4]) == PNG[:4]:
        _require_whole_chunks(memoryview(data))


def _require_whole_chunks(png: memoryview) -> None:
    """ValueError for a PNG one of whose chunks says that it is longer than the file: OpenCV takes memory for it."""
    at = len(PNG)
    while at + CHUNK <= len(png):
        at += CHUNK + int.from_bytes(png[at : at + 4], "big")
    if at > len(png):
        raise ValueError(f"compressed image: expected a png of {at} bytes, got {len(png)}; truncated?")


def _require_whole_blocks(message: Any) -> None:
    """ValueError for a size that leaves half a pair of pixels that share their colour."""
    across, down = BLOCKS.get(message.encoding, (1, 1))
    if int(message.width) % across or int(message.height) % down:
        wanted = "an even width" if down == 1 else "an even width and height"
        got = f"{message.width} × {message.height}"
        raise ValueError(f"image: expected {wanted} for {message.encoding}, got {got}")


def _of_planes(message: Any, most_pixels: int) -> Array:
    """(H, W, 3) RGB of a picture whose brightness comes before its colour; a row of that is as long as its share."""
    rows, width_of_colour, conversion = PLANES[message.encoding]
    height, width, step = int(message.height), int(message.width), int(message.step)
    _require_size(width, height, most_pixels)
    if step < width:
        raise ValueError(f"image: expected a step of at least {width} bytes for {message.encoding}, got {step}")
    data, expected = (
        np.frombuffer(message.data, np.uint8),
        height * step + round(height * rows) * width_of_colour * step,
    )
    if data.size < expected:
        raise ValueError(f"image: expected {expected} bytes for {width} × {height}, got {data.size}; truncated?")
    bright = data[: height * step].reshape(height, step)[:, :width]
    colour = data[height * step : expected].reshape(round(height * rows), -1)[:, : width * width_of_colour]
    if width_of_colour == 1:
        return cv2.cvtColor(np.vstack([bright, colour]), conversion)
    pairs = np.stack([bright, colour[:, ::2], bright, colour[:, 1::2]], axis=-1)  # each pixel twice: two share a colour
    return np.ascontiguousarray(cv2.cvtColor(pairs.reshape(height, 2 * width, 2), conversion)[:, ::2])


def _require_size(width: int, height: int, most_pixels: int) -> None:
    if height <= 0 or width <= 0:
        raise ValueError(f"image: expected pixels, got {width} × {height}")
    if max(width, height) > limits.MOST_SIDE:
        raise ValueError(f"image: expected at most {limits.MOST_SIDE} pixels a side, got {width} × {height}")
    if width * height > most_pixels:
        raise ValueError(f"image: expected at most {most_pixels} pixels, got {width} × {height}")


def _pixels(message: Any, dtype: str, channels: int, most_pixels: int) -> Array:
    """(H, W) or (H, W, channels) in native byte order; contiguous; a view of the message where it can be."""
    kind = np.dtype((">" if message.is_bigendian else "<") + dtype)
    height, width, step = int(message.height), int(message.width), int(message.step)
    line = width * channels * kind.itemsize
    _require_size(width, height, most_pixels)
    step = step if height > 1 else max(step, line)
    if step < line:
        raise ValueError(f"image: expected a step of at least {line} bytes for {message.encoding}, got {step}")
    data = np.frombuffer(message.data, np.uint8)
    if data.size < (height - 1) * step + line:
        expected = (height - 1) * step + line
        raise ValueError(f"image: expected {expected} bytes for {width} × {height}, got {data.size}; truncated?")
    shape, strides = (height, width, channels), (step, channels * kind.itemsize, kind.itemsize)
    pixels = np.ndarray(shape, kind, buffer=data, strides=strides)
    return np.ascontiguousarray(pixels[..., 0] if channels == 1 else pixels, kind.newbyteorder("="))


def _metres(pixels: Array) -> Array:
    """16-bit millimetres as metres; 65535 means nothing measured."""
    return np.where(pixels == NO_DEPTH, np.float32(0), pixels * np.float32(DEPTH_SCALE))


def _measured(metres: Array) -> Array:
    """Floating depth with 0 where it is NaN, not in front of the camera, or farther than anything is measured."""
    metres[~((metres > 0) & (metres <= limits.MOST_DEPTH))] = 0
    return metres


def _decoded(data: Any, flags: int, conversion: int | None, expected: str) -> Array:
    buffer = np.frombuffer(data, np.uint8)
    try:
        pixels = cv2.imdecode(buffer, flags)
    except (cv2.error, MemoryError) as error:
        got = f"{buffer.size} bytes that OpenCV refuses: {' '.join(str(error).split())}"
        raise ValueError(f"compressed image: expected {expected}, got {got}") from error
    if pixels is None:
        raise ValueError(f"compressed image: expected {expected}, got {buffer.size} bytes that do not decode")
    return np.asarray(pixels if conversion is None else cv2.cvtColor(pixels, conversion))


def _compressed_depth(message: Any, most_pixels: int) -> Array:
    """16-bit millimetres, or quantised inverse depth with its two constants (compressedDepth of 32FC1)."""
    data = np.frombuffer(message.data, np.uint8)
    if "compressedDepth" not in message.format:
        return _metres(_depth_png(data, "a 16-bit png", most_pixels))
    packed = data[COMPRESSED_DEPTH_HEADER:]
    if RVL.search(message.format):
        pixels = _depth_rvl(packed, most_pixels)
    else:
        pixels = _depth_png(packed, "compressedDepth png", most_pixels)
    if not message.format.startswith("32FC1"):
        return _metres(pixels)
    a, b = data[4:COMPRESSED_DEPTH_HEADER].view("<f4")
    with np.errstate(all="ignore"):
        metres = (np.float32(a) / (pixels.astype(np.float32) - np.float32(b))).astype(np.float32)
    return _measured(np.where(pixels == 0, np.float32(0), metres))


def _depth_png(data: Array, expected: str, most_pixels: int) -> Array:
    require_picture(data.tobytes(), ("PNG",), most_pixels)
    return _one_channel(_decoded(data, cv2.IMREAD_UNCHANGED, None, expected))


def _depth_rvl(packed: Array, most_pixels: int) -> Array:
    _require_size(*rvl.size(packed), most_pixels)
    return rvl.unpack(packed)


def _one_channel(pixels: Array) -> Array:
    if pixels.ndim != 2 or pixels.dtype != np.uint16:
        raise ValueError(f"compressed depth: expected 16 bits of one channel, got {pixels.dtype} {pixels.shape}")
    return pixels
