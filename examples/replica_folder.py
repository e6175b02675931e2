# SPDX-License-Identifier: Apache-2.0
"""A corrected recording in Replica's layout, which nvblox reads: `replica_folder.py REC path.txt OUT`.

path.txt is of `objreg offline REC --tum path.txt`; OUT/scene is the scene.
"""

import json
import sys
from pathlib import Path

import cv2
import numpy as np

from objreg_ros.geometry import mounting
from objreg_tools.recording import open_recording
from objreg_tools.recording.inputs import choose_inputs
from objreg_tools.report.run.pictures import Album

MM = 1000


def main(recording: str, path: str, out: str) -> None:
    """Write colour, registered depth and `T_map_camera` of each pose that has pictures, and the camera."""
    scene, poses = Path(out, "scene"), []
    (scene / "results").mkdir(parents=True)
    with open_recording(recording) as source:
        album = Album(source, choose_inputs(source.topics))
        for stamp, *numbers in map(str.split, Path(path).read_text(encoding="utf-8").splitlines()):
            if (seen := album.at(int(stamp.replace(".", "")))) is None:  # ns; a float does not hold those of a date
                continue
            cv2.imwrite(str(scene / f"results/frame{len(poses):06d}.jpg"), seen.rgb[..., ::-1])
            cv2.imwrite(str(scene / f"results/depth{len(poses):06d}.png"), (MM * seen.depth).round().astype(np.uint16))
            poses.append(mounting([float(number) for number in numbers]).ravel())
            c = seen.intrinsics
    camera = {"w": c.width, "h": c.height, "fx": c.fx, "fy": c.fy, "cx": c.cx, "cy": c.cy, "scale": MM}
    Path(out, "cam_params.json").write_text(json.dumps({"camera": camera}, indent=1), encoding="utf-8")
    np.savetxt(scene / "traj.txt", poses)


main(*sys.argv[1:]) if len(sys.argv) == 4 else sys.exit(__doc__)
