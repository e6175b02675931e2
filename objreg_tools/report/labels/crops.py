# SPDX-License-Identifier: Apache-2.0
"""Small pictures of each object, spread over its time in the run, by which a person checks and names it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_tools.report.labels.visible_part import VisiblePart
from objreg_tools.report.run.pictures import picture_uri

TILE = 112  # px of a crop
MOST = 8  # crops of an object
AROUND = 1.4  # how much wider than the box the crop is
BORDER = (230, 60, 160)  # of the mask, a colour that few things have
QUALITY = 80


class Crop(NamedTuple):
    """A crop as a data URI, of when."""

    stamp_ns: int
    picture: str


@dataclass
class Crops:
    """Up to `MOST` crops of one object, evenly spread over those that came; ``count`` is how many came."""

    count: int = 0
    _every: int = 1
    _kept: list[Crop] = field(default_factory=list)

    def add(self, stamp_ns: int, rgb: Array, part: VisiblePart) -> None:
        """Take in what one picture shows."""
        if self.count % self._every == 0:
            if len(self._kept) == 2 * MOST:
                self._kept, self._every = self._kept[::2], 2 * self._every
            if self.count % self._every == 0:
                self._kept.append(Crop(stamp_ns, picture_uri(crop(rgb, part), QUALITY)))
        self.count += 1

    @property
    def chosen(self) -> list[Crop]:
        """Those to show, by time."""
        places = np.unique(np.linspace(0, len(self._kept) - 1, min(MOST, len(self._kept))).round().astype(int))
        return [self._kept[place] for place in places]


def crop(rgb: Array, part: VisiblePart) -> Array:
    """(TILE, TILE, 3) uint8 RGB: the object with the border of its mask; grey where the picture ends."""
    x_min, y_min, x_max, y_max = part.xyxy
    side = AROUND * max(x_max - x_min, y_max - y_min)
    scale = TILE / side
    left, top = (x_min + x_max - side) / 2, (y_min + y_max - side) / 2
    to_tile = np.array([[scale, 0, -scale * left], [0, scale, -scale * top]])
    flags = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    picture = cv2.warpAffine(np.ascontiguousarray(rgb), to_tile, (TILE, TILE), flags=flags, borderValue=(128, 128, 128))
    x, y = part.corner
    of_mask = np.array([[scale, 0, scale * (x - left)], [0, scale, scale * (y - top)]])
    mask = cv2.warpAffine(part.mask.astype(np.uint8), of_mask, (TILE, TILE), flags=cv2.INTER_NEAREST)
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return np.asarray(cv2.drawContours(picture, contours, -1, BORDER, 1))
