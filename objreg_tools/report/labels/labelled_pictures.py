# SPDX-License-Identifier: Apache-2.0
"""Every picture of a run with the objects that it shows: tracked on the map, not detected in the picture."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import UNNAMED
from objreg_ros.data.images import DepthImage
from objreg_ros.segmenter.sensor.sensor_estimate import SensorEstimate
from objreg_tools.report.labels.mapped_objects import MappedObject
from objreg_tools.report.labels.visible_part import VisiblePart, visible_part
from objreg_tools.report.run.pictures import Album

SAME_SHARE = 0.6  # of the smaller of two masks that are of one object
LEAST_SHARE = 0.3  # of its outline that has to be seen, unless something else is asked for


@dataclass(frozen=True, slots=True, eq=False)
class LabelledPicture:
    """A picture ``rgb (H, W, 3)`` without lens distortion, and what it shows of objects."""

    stamp_ns: int
    rgb: Array
    parts: tuple[VisiblePart, ...]


def labelled_pictures(
    objects: Sequence[MappedObject],
    poses: Iterable[tuple[int, Array]],
    album: Album,
    least_share: float = LEAST_SHARE,
) -> Iterator[LabelledPicture]:
    """The pictures at ``poses``, (stamp, ``T_map_camera``) by time; those that cannot be read are left out.

    An object of which less than ``least_share`` is seen is not labelled. Depth is brought upon colour as the segmenter
    does it.
    """
    sensor = SensorEstimate()
    for stamp_ns, T_map_camera in poses:
        image = album.at(stamp_ns)
        if image is None or image.rgb is None:
            continue
        image = sensor.register(_in_order(image))
        parts = [part for one in objects if (part := visible_part(one, image, T_map_camera)) is not None]
        shown = tuple(part for part in apart(parts) if part.share >= least_share)
        yield LabelledPicture(stamp_ns, np.asarray(image.rgb), shown)


def apart(parts: Sequence[VisiblePart]) -> list[VisiblePart]:
    """The parts with every pixel in one of them at most: the one whose depth is nearest to what was measured.

    Of two that cover each other one is left: that with a name, else that with more views.
    """
    left: list[VisiblePart] = []
    for part in sorted(parts, key=lambda part: (part.object.label == UNNAMED, -len(part.object.views))):
        if all(_covered(part, other) < SAME_SHARE for other in left):
            left.append(part)
    for k, part in enumerate(left):
        for j in range(k):
            part, left[j] = _parted(part, left[j])
        left[k] = part
    order = {one.object.landmark: one for one in left if one.mask.any()}
    return [order[number] for number in sorted(order)]


def _in_order(image: DepthImage) -> DepthImage:
    rgb = None if image.rgb is None else np.ascontiguousarray(image.rgb)
    return replace(image, depth=np.ascontiguousarray(image.depth), rgb=rgb)


def _common(a: VisiblePart, b: VisiblePart) -> tuple[tuple[slice, slice], tuple[slice, slice]] | None:
    """The window that two parts share, in the pixels of each; None where they share none."""
    (ax, ay), (bx, by) = a.corner, b.corner
    x, y = max(ax, bx), max(ay, by)
    x_end = min(ax + a.mask.shape[1], bx + b.mask.shape[1])
    y_end = min(ay + a.mask.shape[0], by + b.mask.shape[0])
    if x >= x_end or y >= y_end:
        return None
    return (np.s_[y - ay : y_end - ay, x - ax : x_end - ax], np.s_[y - by : y_end - by, x - bx : x_end - bx])


def _covered(a: VisiblePart, b: VisiblePart) -> float:
    """The share of the smaller mask that is in the other."""
    windows = _common(a, b)
    if windows is None:
        return 0.0
    both = int((a.mask[windows[0]] & b.mask[windows[1]]).sum())
    return both / max(1, min(a.pixels, b.pixels))


def _parted(a: VisiblePart, b: VisiblePart) -> tuple[VisiblePart, VisiblePart]:
    """Both with the pixels that they share given to one."""
    windows = _common(a, b)
    if windows is None:
        return a, b
    of_a, of_b = windows
    both = a.mask[of_a] & b.mask[of_b]
    if not both.any():
        return a, b
    nearer = a.off[of_a] <= b.off[of_b]
    mask_a, mask_b = a.mask.copy(), b.mask.copy()
    mask_a[of_a] &= ~(both & ~nearer)
    mask_b[of_b] &= ~(both & nearer)
    return replace(a, mask=mask_a), replace(b, mask=mask_b)
