# SPDX-License-Identifier: Apache-2.0
"""Two coloured clouds from PLY files: `ply_pair.py one.ply two.ply FX FY CX CY WIDTH HEIGHT`, the camera in pixels.

Points are metres in the optical frame of their camera: x to the right, y down, z forward. `pip install open3d` reads.
"""

import sys

import numpy as np

from objreg_ros import Camera, register_clouds

try:
    import open3d as o3d
except ImportError:
    raise SystemExit("expected open3d, got none: pip install open3d") from None


def read(path: str) -> tuple[np.ndarray, np.ndarray]:
    """``xyz (N, 3) float64`` and ``rgb (N, 3) uint8`` of a file; SystemExit where it has no points or no colours."""
    cloud = o3d.io.read_point_cloud(path)
    if not cloud.has_points() or not cloud.has_colors():
        raise SystemExit(f"{path}: expected a PLY file of points with colours, got none")
    return np.asarray(cloud.points), (np.asarray(cloud.colors) * 255).round().astype(np.uint8)


def main(one: str, two: str, *camera: str) -> None:
    """Register the clouds and print the pose, or why there is none."""
    fx, fy, cx, cy = map(float, camera[:4])
    width, height = map(int, camera[4:])
    result = register_clouds(*read(one), *read(two), Camera(fx, fy, cx, cy, width, height))
    if not result.accepted:
        raise SystemExit(f"refused: {result.reason}, {result.detail}")
    print(f"accepted, T_1_2:\n{result.T_1_2.round(3)}")


if __name__ == "__main__":
    if len(sys.argv) != 9:
        raise SystemExit(__doc__)
    main(*sys.argv[1:])
