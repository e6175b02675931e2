# SPDX-License-Identifier: Apache-2.0
"""Two RGB-D pictures of a simulated room: the pose between their cameras, or why there is none."""

import numpy as np

from objreg_ros import Camera, register
from objreg_ros.geometry import inverse, pose_error
from objreg_tools.simulation.rendering.render import Rendering, render
from objreg_tools.simulation.scenarios import make_plan


def main() -> None:
    """Register what is seen from one place and from a little beside it."""
    plan = make_plan("orbit", seed=7, frames=120)
    first, second = (picture(plan, k) for k in (0, 8))
    seen = first.intrinsics
    camera = Camera(seen.fx, seen.fy, seen.cx, seen.cy)
    result = register(first.rgb, first.depth, second.rgb, second.depth, camera)
    for name, number in result.evidence.items():
        print(f"{name:>22} {number:.3f}")
    if not result.accepted:
        print(f"refused: {result.reason}, {result.detail}")
        return
    degrees, cm = pose_error(result.T_1_2, inverse(first.T_world_camera) @ second.T_world_camera)
    print(f"accepted: moved by {np.round(result.T_1_2[:3, 3], 3)} m")
    print(f"standard deviations {np.sqrt(np.diag(result.covariance)).round(4)} m and rad")
    print(f"off by {degrees:.2f} deg and {cm:.1f} cm")


def picture(plan, k: int) -> Rendering:
    """Frame ``k`` of the story, as the simulated camera sees it."""
    return render(plan.scenes[int(plan.scene_of[k])], plan.T_world_camera[k], seed=k, threads=2)


if __name__ == "__main__":
    main()
