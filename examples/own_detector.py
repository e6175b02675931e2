# SPDX-License-Identifier: Apache-2.0
"""A detector of one's own is any function of the picture. Here it is one that knows the simulator's truth."""

import numpy as np

from objreg_ros import Camera, register
from objreg_tools.simulation.rendering.render import render
from objreg_tools.simulation.scenarios import make_plan


def main() -> None:
    """Register with boxes, and with masks."""
    plan = make_plan("orbit", seed=7, frames=120)
    shots = [render(plan.scenes[0], plan.T_world_camera[k], seed=k, threads=2) for k in (0, 8)]
    camera = Camera(*(getattr(shots[0].intrinsics, name) for name in ("fx", "fy", "cx", "cy")))

    def boxes(rgb: np.ndarray) -> list[tuple[np.ndarray, str, float]]:
        """``(x_min y_min x_max y_max, label, score)`` of each object of the picture."""
        shot = next(shot for shot in shots if shot.rgb is rgb)
        return [(seen.xyxy, seen.label, 0.9) for seen in shot.objects]

    def masks(rgb: np.ndarray) -> list[tuple[np.ndarray, str, float]]:
        """``(mask (H, W) bool, label, score)`` of each."""
        shot = next(shot for shot in shots if shot.rgb is rgb)
        return [(shot.instance == seen.instance, seen.label, 0.9) for seen in shot.objects]

    pictures = (shots[0].rgb, shots[0].depth, shots[1].rgb, shots[1].depth)
    for detector in (boxes, masks):
        result = register(*pictures, camera, detector=detector)
        answer = f"moved by {result.T_1_2[:3, 3].round(3)} m" if result.accepted else f"refused: {result.reason}"
        print(f"{detector.__name__}: {answer}, {result.evidence.get('matched', 0):.0f} objects matched")


if __name__ == "__main__":
    main()
