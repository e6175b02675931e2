# SPDX-License-Identifier: Apache-2.0
"""The points of a binary PLY file."""

from __future__ import annotations

from pathlib import Path

import numpy as np


def read_ply(path: Path) -> np.ndarray:
    """The vertices by the names of their properties."""
    header, body = path.read_bytes().split(b"end_header\n", 1)
    kinds = {b"double": "<f8", b"float": "<f4", b"uchar": "u1"}
    fields = [(line.split()[2].decode(), kinds[line.split()[1]]) for line in header.split(b"\n") if b"property" in line]
    return np.frombuffer(body, fields)


def positions(table: np.ndarray) -> np.ndarray:
    """Their (N, 3) positions."""
    return np.stack([table["x"], table["y"], table["z"]], axis=1)
