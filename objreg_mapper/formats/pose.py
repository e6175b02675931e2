# SPDX-License-Identifier: Apache-2.0
"""A pose into the fields of any message."""

from __future__ import annotations

from typing import Any

from objreg_ros.data.checked import Array
from objreg_ros.geometry import quaternion_from_rotation


def fill_pose(where: Any, turn: Any, T: Array) -> None:
    """Set x y z of ``where`` and x y z w of ``turn`` to the pose ``T (4, 4)``."""
    where.x, where.y, where.z = map(float, T[:3, 3])
    turn.x, turn.y, turn.z, turn.w = map(float, quaternion_from_rotation(T[:3, :3]))
