# SPDX-License-Identifier: Apache-2.0
"""The error of gravity from a single view, by its confidence: the numbers behind `sensor.SIGMA_DEG`.

    python training/gravity.py            # some minutes; prints a table

Rooms of every scenario are seen by every simulated sensor, with and without stress. The tilt of what the segmenter
gives is compared with the truth. Real rooms are less level than simulated ones, so `SIGMA_DEG` is `MARGIN` times this.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import click
import numpy as np
from tqdm import tqdm

from objreg_ros.data.images import DepthImage, Detections, Intrinsics
from objreg_ros.segmenter.segment import Segmenter
from objreg_ros.sensor import CONFIDENCE, SIGMA_DEG
from objreg_tools.cli.commands.simulate import HARD
from objreg_tools.simulation.params import StressParams
from objreg_tools.simulation.rendering.render import render
from objreg_tools.simulation.scenarios import OF_ONE_DAY, make_plan
from objreg_tools.simulation.sensors.camera import CAMERAS, SENSORS

MARGIN = 1.5
EDGES = (
    0.1,
    0.3,
    0.4,
    0.6,
    0.8,
    0.9,
    0.98,
    1.01,
)  # of the bins of confidence; each is for one of `CONFIDENCE`, or none


def tilts(seeds: int, frames: int) -> Iterator[tuple[float, float]]:
    """The confidence and the squared tilt in degrees² of every view that has gravity."""
    runs = [(s, n, k) for s in SENSORS for n in OF_ONE_DAY for k in range(seeds)]
    for sensor, scenario, seed in tqdm(runs, unit="room"):
        name, depth = SENSORS[sensor]
        camera = CAMERAS[name]
        plan, segmenter = make_plan(scenario, seed + 500, frames), Segmenter()
        stress = StressParams.from_mapping(HARD if seed % 2 else {})
        for k, T_world_camera in enumerate(plan.T_world_camera):
            scene = plan.scenes[plan.scene_of[k]]
            seen = render(scene, T_world_camera, camera, seed=k, depth=depth, stress=stress, with_colour=False)
            frame = segmenter.segment(nothing(seen.depth.shape), image_of(seen.depth, camera))
            if frame.gravity is not None:
                down = T_world_camera[:3, :3] @ frame.gravity
                yield frame.gravity_confidence, float(np.degrees(np.arccos(np.clip(-down[2], -1.0, 1.0))) ** 2)


def image_of(depth: np.ndarray, camera: Intrinsics) -> DepthImage:
    """Depth without colour."""
    return DepthImage(depth=depth, rgb=None, intrinsics=camera, stamp_ns=0)


def nothing(shape: tuple[int, int]) -> Detections:
    """No objects."""
    return Detections(
        xyxy=np.zeros((0, 4), np.float32), score=np.zeros(0, np.float32), label=(), image_hw=shape, stamp_ns=0
    )


def sigma_deg(squared_deg: np.ndarray) -> float:
    """The standard deviation of either tilt, of squared angles: gross errors are for what weak gravity is left out."""
    return float(np.sqrt(np.median(squared_deg) / (2.0 * np.log(2.0)))) if len(squared_deg) else float("nan")


@click.command()
@click.option("--seeds", default=2, show_default=True, help="Rooms of each scenario and sensor.")
@click.option("--frames", default=24, show_default=True, help="Views of each.")
def main(seeds: int, frames: int) -> None:
    """Print how far gravity errs by its confidence."""
    found = np.array(list(tilts(seeds, frames)))
    click.echo(f"confidence   views   sigma   x {MARGIN}   beyond 10 deg     (SIGMA_DEG {SIGMA_DEG} at {CONFIDENCE})")
    for low, high in pairwise(EDGES):
        squared = found[(found[:, 0] >= low) & (found[:, 0] < high), 1]
        share = float((squared > 100.0).mean()) if len(squared) else float("nan")
        sigma = sigma_deg(squared)
        click.echo(f"{low:.2f}-{high:.2f} {len(squared):9d} {sigma:7.2f} {MARGIN * sigma:7.2f} {share:15.3f}")


if __name__ == "__main__":
    main()
