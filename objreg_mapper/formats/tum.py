# SPDX-License-Identifier: Apache-2.0
"""A trajectory in the text of the TUM RGB-D benchmark: ``stamp tx ty tz qx qy qz qw``, for evo and similar tools."""

from __future__ import annotations

from collections.abc import Iterable

from objreg_ros.data.checked import Array
from objreg_ros.geometry import quaternion_from_rotation

SECOND_NS = 1_000_000_000


def trajectory_text(path: Iterable[tuple[int, Array]]) -> str:
    """The file: a line for each stamp in ns and pose ``T_map_body (4, 4)``; seconds with every digit, and metres."""
    return "".join(f"{_seconds(stamp_ns)} {_pose_text(T)}\n" for stamp_ns, T in path)


def _seconds(stamp_ns: int) -> str:
    """Not by a float, which cannot hold the nanoseconds of a date."""
    whole, rest = divmod(abs(stamp_ns), SECOND_NS)
    return f"{'-' if stamp_ns < 0 else ''}{whole}.{rest:09d}"


def _pose_text(T: Array) -> str:
    return " ".join(f"{value:z.9f}" for value in (*T[:3, 3], *quaternion_from_rotation(T[:3, :3])))
