# SPDX-License-Identifier: Apache-2.0
"""A stream of frames with a memory: the registrar says when the camera is back where it was."""

from objreg_ros import Camera, segment
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.registrar import Registrar
from objreg_tools.simulation.rendering.render import render
from objreg_tools.simulation.scenarios import make_plan

RATE = 2  # frames in a second of a slow camera


def main() -> None:
    """Go there and back again without odometry, and print what the registrar closes and refuses."""
    plan = make_plan("orbit", seed=7, frames=120)
    registrar = Registrar(RegistrarParams(store=""))  # a temporary file; a file name remembers over restarts
    there = list(range(0, 25, 4))
    for n, k in enumerate(there + there[::-1]):
        seen = render(plan.scenes[int(plan.scene_of[k])], plan.T_world_camera[k], seed=n, threads=2)
        camera = Camera(seen.intrinsics.fx, seen.intrinsics.fy, seen.intrinsics.cx, seen.intrinsics.cy)
        frame = segment(seen.rgb, seen.depth, camera, stamp_ns=n * 1_000_000_000 // RATE)
        show(registrar.process(frame))
    show(registrar.finish())
    print(registrar.counts())
    registrar.close()


def show(outcome) -> None:
    """Print what became of a frame."""
    for closure in outcome.closures:
        times = f"{1e-9 * closure.from_ns:.1f} s and {1e-9 * closure.to_ns:.1f} s"
        print(f"closed {times} by {', '.join(closure.labels)}: {closure.T_from_to[:3, 3].round(3)} m")
    for refusal in outcome.rejected:
        print(f"refused at {1e-9 * refusal.to_ns:.1f} s: {refusal.reason.value}, {refusal.detail}")


if __name__ == "__main__":
    main()
