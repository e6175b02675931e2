# SPDX-License-Identifier: Apache-2.0
"""Messages of packages that are not installed, and a closure whose every number differs."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from objreg_mapper.constraint import Constraint
from objreg_ros.data.closures import LoopClosure
from objreg_ros.geometry import pose, rotation_from_vector

QUARTER_LEFT = pose(rotation_from_vector(np.array([0.0, 0.0, np.pi / 2])), np.array([1.0, 2.0, 3.0]))
COVARIANCE = np.diag([1.0, 4.0, 9.0, 16.0, 25.0, 36.0])
CONSTRAINT = Constraint(QUARTER_LEFT, COVARIANCE)
# The axes of *to* are turned: its x is the y of *from*, its y is the minus x of *from*.
LOCAL_INFORMATION_DIAGONAL = 1 / np.array([4.0, 1.0, 9.0, 25.0, 16.0, 36.0])


def closure(from_ns: int = 1_500_000_000, to_ns: int = 63_250_000_000) -> LoopClosure:
    return LoopClosure(from_ns=from_ns, to_ns=to_ns, T_from_to=QUARTER_LEFT, covariance=COVARIANCE, labels=("cup",))


def blank(**fields: Any) -> Any:
    """A message with a position and an orientation under each of the usual names, and ``fields``."""
    vector, turn = SimpleNamespace(x=None, y=None, z=None), SimpleNamespace(x=None, y=None, z=None, w=None)
    where = {"translation": vector, "rotation": turn, "position": vector, "orientation": turn}
    return SimpleNamespace(**where, **fields)


def numbers(message: Any) -> list[float]:
    """x y z of the position and x y z w of the orientation."""
    p, q = message.position, message.orientation
    return [p.x, p.y, p.z, q.x, q.y, q.z, q.w]
