# SPDX-License-Identifier: Apache-2.0
"""Points and texts as a page carries them: 16 bits a coordinate, in base64; some of it zipped."""

from __future__ import annotations

import base64
import gzip
from typing import Any

import numpy as np

from objreg_ros.data.checked import Array

MOST = np.iinfo(np.uint16).max


def packed(xyz: Array) -> dict[str, Any]:
    """Points (N, 3) in m as ``xyz``: all x, all y, all z as little-endian uint16, steps of ``step`` m above ``low``."""
    low = xyz.min(axis=0) if len(xyz) else np.zeros(3)
    step = float((xyz - low).max(initial=0.0)) / MOST or 1.0
    steps = np.rint((xyz - low) / step).astype("<u2")
    return {"low": low.tolist(), "step": step, "xyz": encoded(steps.T)}


def encoded(values: Array) -> str:
    """The bytes of an array, row after row, in base64."""
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")


def zipped(content: bytes) -> str:
    """Bytes as gzip in base64, which `unzip.js` unpacks; always the same for the same bytes."""
    return base64.b64encode(gzip.compress(content, mtime=0)).decode("ascii")
