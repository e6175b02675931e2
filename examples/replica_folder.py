# SPDX-License-Identifier: Apache-2.0
"""A recording in Replica's layout along path.txt of `--tum`, for nvblox: `replica_folder.py REC path.txt OUT`."""

import json
import sys
from pathlib import Path

import cv2
import numpy as np

from objreg_ros.geometry import pose, rotation_from_quaternion
from objreg_tools.recording import open_recording
from objreg_tools.recording.inputs import choose_inputs
from objreg_tools.report.run.pictures import Album

MM = 1000


def main(recording: str, path: str, out: str) -> None:
    """Write colour, registered depth and `T_map_camera` of each pose that has pictures, and the camera."""
    scene, poses = Path(out, "scene"), list[np.ndarray]()
    (scene / "results").mkdir(parents=True)
    with open_recording(recording) as source:
        album = Album(source, choose_inputs(source.topics))
        for stamp, *numbers in map(str.split, Path(path).read_text(encoding="utf-8").splitlines()):
            if (seen := album.at(int(stamp.replace(".", "")))) is None or seen.rgb is None:  # ns, which no float holds
                continue
            cv2.imwrite(str(scene / f"results/frame{len(poses):06d}.jpg"), seen.rgb[..., ::-1])
            cv2.imwrite(str(scene / f"results/depth{len(poses):06d}.png"), (MM * seen.depth).round().astype(np.uint16))
            xyz, xyzw = np.split(np.array(numbers, float), [3])
            poses.append(pose(rotation_from_quaternion(xyzw), xyz).ravel())
            c = seen.intrinsics
    if not poses:
        raise SystemExit(f"{path}: expected stamps of pictures of {recording}, got none")
    camera = {"w": c.width, "h": c.height, "fx": c.fx, "fy": c.fy, "cx": c.cx, "cy": c.cy, "scale": MM}
    Path(out, "cam_params.json").write_text(json.dumps({"camera": camera}, indent=1), encoding="utf-8")
    np.savetxt(scene / "traj.txt", poses)


main(*sys.argv[1:]) if len(sys.argv) == 4 else sys.exit(__doc__)
