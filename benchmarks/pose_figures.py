# SPDX-License-Identifier: Apache-2.0
"""What the truth says of poses that were found, and the shares, medians and percentiles of many."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import pose_error, transform, vector_from_rotation
from objreg_tools.truth import within

SUCCESS = (5.0, 2.0)  # degrees, centimetres


def judged(row: dict[str, Any]) -> dict[str, Any]:
    """The row with what of it is a success."""
    errors = {"success": "error", "engine_success": "engine_error", "stored_success": "stored_error"}
    return row | {name: within(row[error], SUCCESS) for name, error in errors.items() if error in row}


def percentiles(name: str, values: Sequence[float]) -> dict[str, float | None]:
    """The median and the 95th percentile; None without values."""
    return {f"{name}_p{q}": float(np.percentile(values, q)) if values else None for q in (50, 95)}


def error_at(T: Array, truth: Array, point: Array) -> tuple[float, float]:
    """(degrees, centimetres that a point moves too far) of a pose."""
    degrees, _ = pose_error(T, truth)
    return degrees, float(100.0 * np.linalg.norm(transform(T, point) - transform(truth, point)))


def nees(T: Array, truth: Array, C: Array) -> float:
    """The error squared in units of its covariance; its mean is 6 for an honest covariance."""
    e = np.r_[truth[:3, 3] - T[:3, 3], vector_from_rotation(truth[:3, :3] @ T[:3, :3].T)]
    return float(e @ np.linalg.solve(C, e))


def mean(rows: Sequence[dict[str, Any]], key: str) -> float | None:
    """The share of rows that are so; None without rows."""
    return float(np.mean([row[key] for row in rows])) if rows else None


def median(values: Sequence[float]) -> float | None:
    """The median; None without values."""
    return float(np.median(values)) if values else None


def grouped(rows: Sequence[dict[str, Any]], key: str) -> dict[str, float | None]:
    """Success by a key."""
    return {
        str(value): mean([r for r in rows if r[key] == value], "success")
        for value in dict.fromkeys(r[key] for r in rows)
    }
