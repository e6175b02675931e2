# SPDX-License-Identifier: Apache-2.0
"""How a data type checks its fields when it is made, and keeps its arrays from change."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any, TypeVar, dataclass_transform

import numpy as np
from numpy.typing import NDArray

from objreg_ros import limits

Array = NDArray[Any]

SURROGATE = re.compile("[\ud800-\udfff]")  # halves of a character, as broken JSON has them
Data = TypeVar("Data")


@dataclass_transform(kw_only_default=True, frozen_default=True, eq_default=False, field_specifiers=(field,))
def data_type(cls: type[Data]) -> type[Data]:
    """The decorator of a data type: a frozen dataclass with keyword fields and slots."""
    return dataclass(frozen=True, slots=True, kw_only=True, eq=False)(cls)


def hold_array(owner: Any, name: str, dtype: Any, shape: tuple[int | str | None, ...], sizes: dict[str, int]) -> None:
    """Check one array field and make it read-only. A size is a number, a name shared by fields, or None for any."""
    array = getattr(owner, name)
    if not isinstance(array, np.ndarray):
        raise ValueError(f"{_expected(owner, name, dtype, shape)}, got {type(array).__name__}")
    wrong = array.dtype != dtype or array.ndim != len(shape)
    if not wrong:
        for got, size in zip(array.shape, shape, strict=True):
            wanted = sizes.setdefault(size, got) if isinstance(size, str) else size
            wrong = wrong or (wanted is not None and got != wanted)
    if wrong:
        known = {k: v for k, v in sizes.items() if k in shape}
        expected = _expected(owner, name, dtype, shape) + (f" with {known}" if known else "")
        raise ValueError(f"{expected}, got {array.dtype} of shape {array.shape}")
    view = array.view()
    view.flags.writeable = False
    object.__setattr__(owner, name, view)


def _expected(owner: Any, name: str, dtype: Any, shape: tuple[int | str | None, ...]) -> str:
    sizes = ", ".join("any" if size is None else str(size) for size in shape) + ("," if len(shape) == 1 else "")
    return f"{type(owner).__name__}.{name}: expected {np.dtype(dtype)} of shape ({sizes})"


def hold_pose(owner: Any, name: str) -> None:
    hold_array(owner, name, np.float64, (4, 4), {})
    T = getattr(owner, name)
    R = T[:3, :3]
    if not np.isfinite(T).all() or np.abs(R @ R.T - np.eye(3)).max() > 1e-4 or np.linalg.det(R) < 0:
        raise ValueError(f"{type(owner).__name__}.{name}: expected a rigid motion, got {T.tolist()}")


def hold_world_pose(owner: Any, name: str) -> None:
    """A pose in a world, which is somewhere in it."""
    hold_pose(owner, name)
    farthest = float(np.abs(getattr(owner, name)[:3, 3]).max())
    require(owner, farthest <= limits.MOST_DISTANCE, f"{name} within {limits.MOST_DISTANCE:g} m", f"{farthest:g} m")


def require(owner: Any, truth: bool, expected: str, got: object) -> None:
    if not truth:
        raise ValueError(f"{type(owner).__name__}: expected {expected}, got {got}")


def require_reach(owner: Any, xyz: Array, of: str) -> None:
    """No index into a grid or a picture is made of a coordinate beyond `limits.MOST_RANGE`; NaN is none."""
    farthest = float(np.fmax.reduce(np.abs(xyz), axis=None, initial=0.0))
    require(owner, farthest <= limits.MOST_RANGE, f"{of} within {limits.MOST_RANGE:g} m", f"{farthest:g} m")
