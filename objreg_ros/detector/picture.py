# SPDX-License-Identifier: Apache-2.0
"""From a camera's picture to a model's input tensor."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace

import cv2
import numpy as np

from objreg_ros import limits
from objreg_ros.data import Array
from objreg_ros.detector.runtime import Port

MEAN, SCALE = 127.5, 1 / 127.5
EXPECTED = "expected one input, uint8 [1, H, W, 3], or float32 [1, H, W, 3] or [1, 3, H, W]"


@dataclass(frozen=True)
class Picture:
    """How a model wants its picture: size (None where the graph takes any), layout and number range."""

    height: int | None
    width: int | None
    channels_first: bool
    floating: bool
    mean: Array
    scale: Array

    @classmethod
    def of(cls, inputs: tuple[Port, ...], metadata: Mapping[str, str]) -> Picture:
        """The picture that the graph's input asks for; ValueError when it is no picture."""
        got = ", ".join(map(str, inputs))
        if len(inputs) != 1 or len(inputs[0].shape) != 4 or inputs[0].dtype not in ("uint8", "float"):
            raise ValueError(f"input of the model: {EXPECTED}, got {got}")
        batch, *size, last = inputs[0].shape
        floating = inputs[0].dtype == "float"
        channels_first = floating and size[0] == 3 and last != 3
        if batch not in (1, None) or not (channels_first or last in (3, None)):
            raise ValueError(f"input of the model: {EXPECTED}, got {got}")
        height, width = (size[1], last) if channels_first else size
        _require_size(height, width, got)
        mean, scale = (_numbers(metadata, f"objreg.{key}", usual) for key, usual in (("mean", MEAN), ("scale", SCALE)))
        return cls(height, width, channels_first, floating, mean, scale)

    def sized(self, height: int, width: int) -> Picture:
        """The same of one size, where the graph takes any."""
        return replace(self, height=self.height or height, width=self.width or width)

    def tensor(self, rgb: Array) -> Array:
        """The input tensor for ``rgb (H, W, 3) uint8``."""
        height, width = self.height or rgb.shape[0], self.width or rgb.shape[1]
        if (height, width) != rgb.shape[:2]:
            rgb = cv2.resize(rgb, (width, height), interpolation=cv2.INTER_LINEAR)
        if self.floating:
            rgb = (rgb.astype(np.float32) - self.mean) * self.scale
        return np.ascontiguousarray((rgb.transpose(2, 0, 1) if self.channels_first else rgb)[None])


def _require_size(height: int | None, width: int | None, got: str) -> None:
    """ValueError for a picture that takes too much memory, before it is taken. A side of None or 0 is open."""
    sides = (height or 1, width or 1)
    most = limits.MOST_PIXELS_OF_PICTURE  # what a camera's is made to fit takes memory, and so does the test picture
    if min(sides) < 0 or sides[0] * sides[1] > most:
        raise ValueError(
            f"input of the model: expected a picture of at most {most} pixels, got {got}; "
            "export the model for smaller pictures"
        )


def _numbers(metadata: Mapping[str, str], key: str, usual: float) -> Array:
    """One number or three, of a metadata entry."""
    try:
        numbers = np.broadcast_to(np.asarray(json.loads(metadata.get(key, str(usual))), np.float32), (3,))
    except (ValueError, TypeError, RecursionError, OverflowError) as error:
        raise ValueError(f"{key}: expected a number or a list of three, got {metadata[key][:80]!r}") from error
    if not np.isfinite(numbers).all():
        raise ValueError(f"{key}: expected finite numbers, got {metadata[key][:80]!r}")
    return numbers
