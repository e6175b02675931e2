# SPDX-License-Identifier: Apache-2.0
"""How fast the simulator is, stage by stage and as a whole, and how its depth noise compares to the model's.

    python benchmarks/simulation.py --json simulation.json [--quick] [--picture sensors.png]

``stages``: milliseconds of processor time a frame (median) of one thread at 640x480 over the views of a `loop`.
``frame_ms``: wall time of a whole frame with 1 and 2 threads, p50 and p95, and ``depth_only_ms``; ``processor_ms``: the
processor time of one by two threads, which a busy machine changes little. ``recording_fps``:
frames a second of a whole recording, everything included. ``noise``: standard deviation of a wall's depth in
millimetres by distance, measured and by the model with its quantisation. The picture has a room through every sensor,
colour beside depth, and last through a Kinect with a lens, a lag, a rolling shutter, blur and misregistration.
"""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_tools.simulation.params import ColourParams, DepthParams, RigParams, StressParams
from objreg_tools.simulation.rendering.light import looking
from objreg_tools.simulation.rendering.raster import Projection
from objreg_tools.simulation.rendering.render import Rendering, render, see
from objreg_tools.simulation.rendering.shade import shade
from objreg_tools.simulation.scenarios import RecordingPlan, make_plan
from objreg_tools.simulation.sensors.camera import CAMERAS, KINECT, LENSES, SENSORS, ColourSensor
from objreg_tools.simulation.sensors.noise import DepthSensor
from objreg_tools.simulation.sensors.rig import Motion, Rig
from objreg_tools.simulation.world.mesh import Material, box
from objreg_tools.simulation.world.scene import Scene
from objreg_tools.simulation.write import simulate

SHAPE = (KINECT.height, KINECT.width)
BUILT = RigParams(distortion=LENSES["webcam"], lag_ms=30.0, rolling_ms=25.0, blur_ms=12.0, misregistration_px=4.0)
SHOWN = 6
"""The frame of the recording that the picture shows."""
DISTANCES_M = (0.6, 1.0, 1.5, 2.0, 3.0, 4.0)


class Stages:
    """Processor time of named stages."""

    def __init__(self) -> None:
        self.ms: dict[str, list[float]] = {}

    def take(self, name: str, work: Callable[[], Any]) -> Any:
        """Do ``work`` and book its time."""
        start = time.thread_time()
        result = work()
        self.ms.setdefault(name, []).append(1e3 * (time.thread_time() - start))
        return result


def one_frame(scene: Scene, T: Array, seed: int, stages: Stages) -> None:
    """A frame like `render` makes it, by stages."""
    s = scene.surfaces
    nearness, triangle = np.empty(SHAPE, np.float32), np.empty(SHAPE, np.int32)
    light, depth, rgb = np.empty((*SHAPE, 3), np.uint16), np.empty(SHAPE, np.float32), np.empty((*SHAPE, 3), np.uint8)
    rows = (0, SHAPE[0])
    projection = stages.take("set up", lambda: Projection(s.vertices, s.faces, s.open_surface, T, KINECT))
    stages.take("raster", lambda: projection.fill(nearness, triangle, *rows))
    lit = (s, T, scene.lamps, scene.ambient, scene.shadows, rows, light)
    stages.take("shade", lambda: shade(projection, nearness, triangle, *lit))
    sensor = DepthSensor(DepthParams(), StressParams(), seed, SHAPE, s)
    stages.take("depth noise", lambda: sensor.sense(projection, nearness, triangle, rows, depth))
    camera = ColourSensor(ColourParams(), StressParams(), seed)
    raw, gains = stages.take("expose", lambda: camera.exposed(light))
    stages.take("colour noise", lambda: camera.develop(raw, gains, rows, rgb))
    instance = np.where(triangle >= 0, s.instance[triangle], 0).astype(np.uint16)
    stages.take("truth", lambda: see(scene, instance, T, KINECT))


def whole_frames(plan: RecordingPlan, views: Array, **options: Any) -> list[float]:
    """Wall milliseconds of every view."""
    out = []
    for k, T in enumerate(views):
        start = time.perf_counter()
        render(plan.scenes[0], T, seed=k, **options)
        out.append(1e3 * (time.perf_counter() - start))
    return out


def processor_time(plan: RecordingPlan, views: Array) -> float:
    """Milliseconds of processor time a frame, of both threads together."""
    start = time.process_time()
    whole_frames(plan, views, threads=2)
    return 1e3 * (time.process_time() - start) / len(views)


def recording_rate(frames: int) -> float:
    """Frames a second of a whole recording, from nothing to the closed bag."""
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        simulate(Path(folder) / "loop", "loop", seed=1, frames=frames)
        return frames / (time.perf_counter() - start)


def wall_noise(metres: float) -> dict[str, float]:
    """Standard deviation of the depth of a wall, in mm, and what the model says."""
    grey = Material(np.full((4, 4, 3), 128, np.uint8))
    scene = Scene((), (box((40.0, 1.0, 40.0), grey).moved(y=metres + 0.5, z=-20.0),), (), np.full(3, 0.5))
    view = looking(np.zeros(3), np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]))
    depth = render(scene, view, with_colour=False).depth
    model = np.hypot(0.0012 + 0.0019 * (metres - 0.4) ** 2, 0.00285 * metres**2 / np.sqrt(12))
    return {"measured_mm": 1e3 * float(depth[depth > 0].std()), "model_mm": 1e3 * float(model)}


def draw_sensors(path: Path, plan: RecordingPlan) -> None:
    """A room through every sensor, colour beside depth (0.4 m red to 5 m blue, black for none)."""
    scene, T = plan.scenes[0], plan.T_world_camera[SHOWN]
    images = [render(scene, T, CAMERAS[camera], 1, depth) for camera, depth in SENSORS.values()]
    motion = Motion(plan.T_world_camera, plan.rate)
    images.append(Rig(BUILT, KINECT, 1).take_picture(scene, motion, SHOWN / plan.rate, 1))
    cv2.imwrite(str(path), np.vstack([_beside(image) for image in images]))


def _beside(image: Rendering) -> Array:
    assert image.rgb is not None
    near = np.clip(255 * (5.0 - image.depth) / 4.6, 0, 255).astype(np.uint8)
    coloured = cv2.applyColorMap(near, cv2.COLORMAP_TURBO)
    coloured[image.depth == 0] = 0
    return np.hstack([image.rgb[..., ::-1], coloured])


def quantiles(ms: list[float]) -> dict[str, float]:
    """p50 and p95."""
    return {"p50": float(np.median(ms)), "p95": float(np.percentile(ms, 95))}


@click.command()
@click.option("--json", "json_file", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
@click.option("--quick", is_flag=True, help="Few frames: within half a minute.")
@click.option("--picture", type=click.Path(dir_okay=False, path_type=Path), help="Draw a room through every sensor.")
def command(json_file: Path | None, quick: bool, picture: Path | None) -> None:
    """Time the simulator and print a table."""
    cv2.setNumThreads(1)
    plan = make_plan("loop", 1, frames=60)
    scene = plan.scenes[0]
    scene.prepare()
    views = plan.T_world_camera[:: 6 if quick else 2]
    whole_frames(plan, views[:1])  # compile
    if picture:
        draw_sensors(picture, plan)
    stages = Stages()
    for k, T in enumerate(views):
        one_frame(scene, T, k, stages)
    figures = {
        "triangles": len(scene.surfaces.faces),
        "objects": len(scene.objects),
        "stages": {name: float(np.median(ms)) for name, ms in stages.ms.items()},
        "frame_ms": {str(n): quantiles(whole_frames(plan, views, threads=n)) for n in (1, 2)},
        "processor_ms": processor_time(plan, views),
        "depth_only_ms": quantiles(whole_frames(plan, views, with_colour=False)),
        "recording_fps": recording_rate(60 if quick else 300),
        "noise": {str(metres): wall_noise(metres) for metres in DISTANCES_M},
    }
    show(figures)
    if json_file:
        json_file.write_text(json.dumps(figures, indent=2) + "\n")


def show(figures: dict[str, Any]) -> None:
    """Print the figures."""
    click.echo(f"{figures['objects']} objects, {figures['triangles']} triangles, 640x480")
    for name, ms in figures["stages"].items():
        click.echo(f"  {name:14s}{ms:7.2f} ms")
    for n, ms in figures["frame_ms"].items():
        click.echo(f"whole frame, {n} threads: {ms['p50']:.1f} ms (p95 {ms['p95']:.1f})")
    click.echo(f"processor time of a frame: {figures['processor_ms']:.1f} ms")
    click.echo(f"depth only: {figures['depth_only_ms']['p50']:.1f} ms")
    click.echo(f"recording: {figures['recording_fps']:.1f} frames/s")
    for metres, noise in figures["noise"].items():
        click.echo(f"noise at {metres} m: {noise['measured_mm']:.2f} mm, model {noise['model_mm']:.2f} mm")


if __name__ == "__main__":
    command()
