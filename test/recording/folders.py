# SPDX-License-Identifier: Apache-2.0
"""Small recordings for tests."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from objreg_ros.data import Intrinsics
from objreg_ros.recording import Record, messages

CAMERA = Intrinsics(fx=50.0, fy=50.0, cx=31.5, cy=23.5, width=64, height=48)
STEP_NS = 100_000_000


def tum_folder(path: Path, frames: int = 3, scale: float = 1000, lists: bool = False, lag: float = 0.0) -> Path:
    """A TUM RGB-D folder: frame i is of grey 10 i at i/10 s and 1 m + 0.1 m · i away."""
    (path / "rgb").mkdir(parents=True)
    (path / "depth").mkdir()
    pairs, truth = [], ["# timestamp tx ty tz qx qy qz qw"]
    for i in range(frames):
        t, d = i / 10, i / 10 + lag
        colour, depth = f"rgb/{t:.6f}.png", f"depth/{d:.6f}.png"
        cv2.imwrite(str(path / colour), np.full((48, 64, 3), (10 * i, 0, 200), np.uint8))
        cv2.imwrite(str(path / depth), np.full((48, 64), (1 + 0.1 * i) * scale, np.uint16))
        pairs.append((f"{t:.6f} {colour}", f"{d:.6f} {depth}"))
        truth.append(f"{t:.6f} {0.5 * i} 0 0 0 0 0 1")
    if lists:
        for k, name in enumerate(("rgb", "depth")):
            (path / f"{name}.txt").write_text("# a comment\n" + "\n".join(pair[k] for pair in pairs))
    else:
        (path / "associations.txt").write_text("\n".join(f"{a} {b}" for a, b in pairs))
    (path / "groundtruth.txt").write_text("\n".join(truth))
    camera = {"width": 64, "height": 48, "fx": 50.0, "fy": 50.0, "cx": 31.5, "cy": 23.5, "depth_scale": scale}
    (path / "camera.yaml").write_text("\n".join(f"{name}: {value}" for name, value in camera.items()))
    return path


def records(frames: int = 3) -> Iterator[Record]:
    """Colour and depth with camera_info and odometry, every tenth of a second from 1 s."""
    for i in range(frames):
        stamp_ns = 10**9 + i * STEP_NS
        T_odom_body = np.eye(4)
        T_odom_body[0, 3] = 0.1 * i
        yield Record.of("/camera_info", messages.camera_info(CAMERA, stamp_ns, "camera"), stamp_ns)
        odometry = messages.odometry(T_odom_body, np.eye(6), stamp_ns, "odom", "camera")
        yield Record.of("/odom", odometry, stamp_ns)
        rgb = np.full((48, 64, 3), (i, 20, 30), np.uint8)
        yield Record.of("/image", messages.image(rgb, "rgb8", stamp_ns, "camera"), stamp_ns)
        depth = np.full((48, 64), 1000 + i, np.uint16)
        yield Record.of("/depth/image", messages.image(depth, "16UC1", stamp_ns, "camera"), stamp_ns)
