# SPDX-License-Identifier: Apache-2.0
"""Points as a PLY file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.whole_file import write_whole

AXES = ("x", "y", "z")
COLOURS = ("red", "green", "blue")
KINDS = {"<f8": "double", "<f4": "float", "u1": "uchar"}


def write_ply(path: Path, xyz: Array, normals: Array | None = None, rgb: Array | None = None) -> Path:
    """Write points (N, 3) as binary little-endian PLY: x y z as doubles, and normals as floats and colours, if any.

    Not by Open3D, which writes no empty cloud and reports no error on a full disk. The folder is made.
    """
    columns = list(zip(AXES, ["<f8"] * 3, xyz.T, strict=True))
    if normals is not None:
        columns += zip(("nx", "ny", "nz"), ["<f4"] * 3, normals.T, strict=True)
    if rgb is not None:
        columns += zip(COLOURS, ["u1"] * 3, rgb.T, strict=True)
    table = np.zeros(len(xyz), [(name, kind) for name, kind, _ in columns])
    for name, _, values in columns:
        table[name] = values
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(xyz)}"]
    header += [f"property {KINDS[kind]} {name}" for name, kind, _ in columns] + ["end_header", ""]
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, "\n".join(header).encode() + table.tobytes())
    return path
