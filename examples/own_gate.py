# SPDX-License-Identifier: Apache-2.0
"""A gate of one's own: it has one more condition than ours, and says so where it refuses."""

from collections.abc import Sequence

from objreg_ros import Camera, register
from objreg_ros.data.closures import Reason
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.gate.verdict import Refusal, judge
from objreg_ros.registration.propose.prior import Prior
from objreg_tools.simulation.rendering.render import render
from objreg_tools.simulation.scenarios import make_plan


def several(candidates: Sequence[Candidate], prior: Prior | None = None) -> Candidate | Refusal:
    """What our gate accepts, if at least ``LEAST`` objects lie upon themselves."""
    verdict = judge(candidates, prior)
    if not isinstance(verdict, Candidate) or len(verdict.matched) >= LEAST:
        return verdict
    return Reason.FEW_OBJECTS, f"{len(verdict.matched)} objects < {LEAST}"


LEAST = 50


def main() -> None:
    """The same pair through our gate and through a stricter one."""
    plan = make_plan("orbit", seed=7, frames=120)
    one, two = (render(plan.scenes[0], plan.T_world_camera[k], seed=k, threads=2) for k in (0, 8))
    camera = Camera(*(getattr(one.intrinsics, name) for name in ("fx", "fy", "cx", "cy")))
    for gate in (judge, several):
        result = register(one.rgb, one.depth, two.rgb, two.depth, camera, gate=gate)
        print(f"{gate.__name__}: {'accepted' if result.accepted else f'{result.reason}, {result.detail}'}")


if __name__ == "__main__":
    main()
