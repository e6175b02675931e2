# SPDX-License-Identifier: Apache-2.0
"""From a camera's picture to a model's input tensor."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace

import cv2
import numpy as np

from objreg_ros import limits
from objreg_ros.data.checked import Array
from objreg_ros.detector.runtime import Port

EXPECTED = (
    "expected one input, uint8 [1, H, W, 3], or float32 [1, H, W, 3] or [1, 3, H, W], and at most orig_target_sizes "
    "[1, 2] beside it"
)
AGAIN = "export the model again"
FLOATS = {"float": np.float32, "float16": np.float16}
SIZES = "orig_target_sizes"
"""The second input of RT-DETR and D-FINE: the width and height whose pixels the boxes are in."""

GREY = 114
"""What surrounds a picture that keeps its proportions."""

USUAL_HW, USUAL_SQUARE = (480, 640), (640, 640)
"""Height and width of the test picture of a model that takes any size: rows last, and channels first."""


@dataclass(frozen=True)
class Look:
    """How a family of models wants its picture, where its metadata do not say.

    ``fit``: ``stretched`` to the model's size, or of its own proportions in the ``centre`` or at the ``corner`` (top
    left) of it, grey around. ``mean`` and ``scale``: x = (pixel - mean) * scale, in the order of the channels.
    """

    fit: str = "stretched"
    bgr: bool = False
    mean: float | tuple[float, ...] = 127.5
    scale: float | tuple[float, ...] = 1 / 127.5


@dataclass(frozen=True)
class Placement:
    """Where a camera's picture of ``hw`` lies in a model's of ``model_hw``: top, left, height and width there."""

    hw: tuple[int, int]
    model_hw: tuple[int, int]
    top: int
    left: int
    height: int
    width: int

    @classmethod
    def of(cls, hw: tuple[int, int], model_hw: tuple[int, int], fit: str) -> Placement:
        """The place that ``fit`` gives it."""
        if fit == "stretched":
            return cls(hw, model_hw, 0, 0, *model_hw)
        ratio = min(model_hw[0] / hw[0], model_hw[1] / hw[1])
        if fit == "corner":
            height, width = (max(int(side * ratio), 1) for side in hw)
            return cls(hw, model_hw, 0, 0, height, width)
        height, width = (max(round(side * ratio), 1) for side in hw)
        top, left = (round((model_hw[axis] - side) / 2 - 0.1) for axis, side in enumerate((height, width)))
        return cls(hw, model_hw, top, left, height, width)

    def to_image(self, xyxy: Array) -> Array:
        """Boxes ``(N, 4)`` in 0..1 of the model's picture, in pixels of the camera's."""
        scale = np.array([self.hw[1] / self.width, self.hw[0] / self.height] * 2, np.float32)
        if (self.height, self.width) == self.model_hw:
            return xyxy * np.array([self.hw[1], self.hw[0]] * 2, np.float32)
        pixels = xyxy * np.array([self.model_hw[1], self.model_hw[0]] * 2, np.float32)
        return (pixels - np.array([self.left, self.top] * 2, np.float32)) * scale


@dataclass(frozen=True)
class Picture:
    """How a model wants its picture: size (None where the graph takes any), layout, type and what its family asks."""

    height: int | None
    width: int | None
    channels_first: bool
    dtype: str
    look: Look
    sizes: bool = False

    @classmethod
    def of(cls, inputs: tuple[Port, ...], metadata: Mapping[str, str]) -> Picture:
        """The picture that the graph's first input asks for; ValueError when it is no picture."""
        got = ", ".join(map(str, inputs))
        others = [port.name for port in inputs[1:]]
        dtypes = ("uint8", *FLOATS)
        if not inputs or others not in ([], [SIZES]) or len(inputs[0].shape) != 4 or inputs[0].dtype not in dtypes:
            raise ValueError(f"input of the model: {EXPECTED}, got {got}; export a detector of one picture")
        batch, *size, last = inputs[0].shape
        channels_first = inputs[0].dtype in FLOATS and size[0] == 3 and last != 3
        if batch not in (1, None) or not (channels_first or last in (3, None)):
            raise ValueError(f"input of the model: {EXPECTED}, got {got}; export it with a batch of 1 (batch=1)")
        height, width = (size[1], last) if channels_first else size
        _require_size(height, width, got)
        return cls(height, width, channels_first, inputs[0].dtype, _look(metadata, Look()), bool(others))

    def sized(self, height: int, width: int) -> Picture:
        """The same of one size, where the graph takes any."""
        return replace(self, height=self.height or height, width=self.width or width)

    def asked(self, look: Look, metadata: Mapping[str, str]) -> Picture:
        """The same as a family wants it; mean and scale of the metadata go before."""
        return replace(self, look=_look(metadata, look))

    def usual_hw(self, metadata: Mapping[str, str]) -> tuple[int, int]:
        """Height and width of the test picture: the graph's, else what the metadata say, else the usual ones."""
        own = USUAL_SQUARE if self.channels_first and "objreg.contract" not in metadata else USUAL_HW
        height, width = read_imgsz(metadata) or own
        return self.height or height, self.width or width

    def place(self, rgb: Array) -> Placement:
        """Where ``rgb (H, W, 3)`` lies in the model's picture."""
        height, width = rgb.shape[:2]
        return Placement.of((height, width), (self.height or height, self.width or width), self.look.fit)

    def tensor(self, rgb: Array) -> Array:
        """The input tensor for ``rgb (H, W, 3) uint8``."""
        place = self.place(rgb)
        if (place.height, place.width) != rgb.shape[:2]:
            rgb = cv2.resize(rgb, (place.width, place.height), interpolation=cv2.INTER_LINEAR)
        if (place.height, place.width) != place.model_hw:
            canvas = np.full((*place.model_hw, 3), GREY, np.uint8)
            canvas[place.top : place.top + place.height, place.left : place.left + place.width] = rgb
            rgb = canvas
        if self.look.bgr:
            rgb = rgb[..., ::-1]
        if self.dtype in FLOATS:
            mean, scale = (np.asarray(numbers, np.float32) for numbers in (self.look.mean, self.look.scale))
            rgb = ((rgb.astype(np.float32) - mean) * scale).astype(FLOATS[self.dtype], copy=False)
        return np.ascontiguousarray((rgb.transpose(2, 0, 1) if self.channels_first else rgb)[None])

    def extra(self, tensor: Array) -> dict[str, Array]:
        """The second input, where the graph has one: boxes are asked for in pixels of the model's own picture."""
        height, width = tensor.shape[2:] if self.channels_first else tensor.shape[1:3]
        return {SIZES: np.array([[width, height]], np.int64)} if self.sizes else {}


def read_imgsz(metadata: Mapping[str, str]) -> tuple[int, int] | None:
    """Height and width in Ultralytics' metadata; None where they do not say. ValueError for what is no size."""
    if "imgsz" not in metadata:
        return None
    text = metadata["imgsz"]
    try:
        height, width = np.broadcast_to(np.asarray(json.loads(text[:80].replace("(", "[").replace(")", "]"))), (2,))
        sides = int(height), int(width)
    except (ValueError, TypeError, RecursionError, OverflowError) as error:
        raise ValueError(f"imgsz: expected [height, width], got {text[:80]!r}; {AGAIN}") from error
    if min(sides) < 1:
        raise ValueError(f"imgsz: expected [height, width] above 0, got {text[:80]!r}; {AGAIN}")
    _require_size(*sides, f"imgsz {text[:80]}")
    return sides


def _look(metadata: Mapping[str, str], look: Look) -> Look:
    """The look of a family, with the mean and scale of the metadata where they say."""
    mean, scale = (_numbers(metadata, f"objreg.{key}") for key in ("mean", "scale"))
    return replace(look, mean=look.mean if mean is None else mean, scale=look.scale if scale is None else scale)


def _require_size(height: int | None, width: int | None, got: str) -> None:
    """ValueError for a picture that takes too much memory, before it is taken. A side of None or 0 is open."""
    sides = (height or 1, width or 1)
    most = limits.MOST_PIXELS_OF_PICTURE  # what a camera's is made to fit takes memory, and so does the test picture
    if min(sides) < 0 or sides[0] * sides[1] > most:
        raise ValueError(
            f"input of the model: expected a picture of at most {most} pixels, got {got}; "
            "export the model for smaller pictures"
        )


def _numbers(metadata: Mapping[str, str], key: str) -> tuple[float, ...] | None:
    """Three numbers of a metadata entry of one or three; None where there is no entry."""
    if key not in metadata:
        return None
    try:
        numbers = np.broadcast_to(np.asarray(json.loads(metadata[key]), np.float32), (3,))
    except (ValueError, TypeError, RecursionError, OverflowError) as error:
        raise ValueError(f"{key}: expected a number or a list of three, got {metadata[key][:80]!r}; {AGAIN}") from error
    if not np.isfinite(numbers).all():
        raise ValueError(f"{key}: expected finite numbers, got {metadata[key][:80]!r}; {AGAIN}")
    return tuple(float(number) for number in numbers)
