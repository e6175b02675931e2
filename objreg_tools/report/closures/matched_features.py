# SPDX-License-Identifier: Apache-2.0
"""Which features of the two pictures of a pair registration matched, and which of these its pose brings together.

No run keeps them: they are found again in the pictures of the recording as registration finds them, so they cost
the robot nothing. Depth is as it was recorded, without what the segmenter corrects of it, so single ones may differ.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.images import DepthImage, Intrinsics
from objreg_ros.registration.params import RegistrationParams
from objreg_ros.registration.prepare.keypoints import KeypointMatches, Keypoints, find_keypoints, match_keypoints
from objreg_ros.registration.score.keypoint_agreement import agreeing
from objreg_ros.segmenter.params import SegmenterParams
from objreg_ros.segmenter.sensor.view import reduced_view, step_for
from objreg_tools.report.closures.matched_objects import GAP, WIDE

MOST = 40  # lines over two pictures: of more none can be followed


class FeatureLines(NamedTuple):
    """Lines ``ends (N, 4)`` int over two pictures, u v u v, at most `MOST`, spread over both; how many features
    ``matched``, and how many of these the pose brings together, ``agreeing``."""

    ends: Array
    matched: int
    agreeing: int

    @property
    def text(self) -> str:
        """The counts in words."""
        return counted(self.agreeing, self.matched)


def keypoints_in(image: DepthImage) -> Keypoints:
    """The keypoints of a picture with depth, as registration finds them with its defaults."""
    segmenter = SegmenterParams()
    z_min, z_max, _ = segmenter.limits
    view = reduced_view(image, step_for(image.intrinsics, segmenter.view_step), z_min, z_max)
    return find_keypoints(view, RegistrationParams().context_range)


def feature_lines(
    first: Keypoints, second: Keypoints, cameras: tuple[Intrinsics, Intrinsics], T_first_second: Array
) -> FeatureLines:
    """The features of two pictures that a pose brings together; without lines where it brings none."""
    matches = match_keypoints(second, first)
    agree = agreeing(matches, T_first_second)
    ends = ends_of(matches, cameras)[agree]
    return FeatureLines(ends[spread(ends)], len(matches), len(ends))


def ends_of(matches: KeypointMatches, cameras: tuple[Intrinsics, Intrinsics]) -> Array:
    """Both ends (M, 4) int of every match over the two pictures, the target's on the left."""
    left = _pixels(matches.target.rays[matches.b], cameras[0])
    right = _pixels(matches.source.rays[matches.a], cameras[1])
    return np.rint(np.hstack([left, right + np.array([WIDE + GAP, 0.0])])).astype(int)


def spread(ends: Array, most: int = MOST) -> Array:
    """Indices of at most so many of the lines (N, 4), in their order: from the first on, each the farthest from those
    before it (Gonzalez, 1985)."""
    chosen, apart = list[int](), np.full(len(ends), np.inf)
    while len(chosen) < min(most, len(ends)):
        chosen.append(int(apart.argmax()))
        apart = np.minimum(apart, np.abs(ends - ends[chosen[-1]]).max(axis=1))
        apart[chosen] = -1.0
    return np.array(sorted(chosen), int)


def counted(some: int, every: int, verb: str = "agree") -> str:
    """How many of the matched features agree with the pose, in words, or whatever the verb says."""
    drawn = f", {MOST} are drawn" if some > MOST else ""
    return f"{some} of {every} matched features {verb} with the pose{drawn}"


def lines_as_svg(ends: Array) -> str:
    """Lines (N, 4) with a dot at either end, as SVG."""
    return "".join(_line_and_dots(*map(int, line)) for line in ends)


def _line_and_dots(u0: int, v0: int, u1: int, v1: int) -> str:
    dots = "".join(f'<circle cx="{u}" cy="{v}" r="2"/>' for u, v in ((u0, v0), (u1, v1)))
    return f'<line x1="{u0}" y1="{v0}" x2="{u1}" y2="{v1}"/>{dots}'


def _pixels(rays: Array, camera: Intrinsics) -> Array:
    """Pixels (N, 2) of lines of sight in a picture that is `WIDE` wide."""
    return (rays * (camera.fx, camera.fy) + (camera.cx, camera.cy)) * (WIDE / camera.width)
