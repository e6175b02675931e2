# SPDX-License-Identifier: Apache-2.0
"""What the stream itself shows of its sensor, beside the simulated truth.

    python benchmarks/sensor.py --json OUT --picture sensor.png

Every depth sensor is carried through rooms with a rig that is built well, one that is misregistered, one with a lag of
depth, and one with both. ``offset``: the rotation that brings depth upon colour, as
`segmenter/sensor/depth_to_colour.py` finds it in every frame, against the true one; that of stereo is not used.
``noise``: that of depth in a Kinect's, as `sensor.depth_noise` measures it. ``lag``: how late depth is behind colour,
as `segmenter/sensor/sensor_estimate.py` finds it, beside the rig's; not that of stereo.
It takes ``--frames 240`` or more: fewer are too far apart.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import numpy as np
from tqdm import tqdm

from objreg_ros.data.checked import Array
from objreg_ros.data.images import DepthImage
from objreg_ros.geometry import inverse, vector_from_rotation
from objreg_ros.segmenter.sensor.depth_to_colour import DepthToColour
from objreg_ros.segmenter.sensor.sensor_estimate import SensorEstimate
from objreg_ros.segmenter.sensor.view import reduced_view, step_for
from objreg_ros.sensor import depth_noise
from objreg_tools.simulation.params import RigParams
from objreg_tools.simulation.scenarios import make_plan
from objreg_tools.simulation.sensors.camera import CAMERAS, SENSORS
from objreg_tools.simulation.sensors.rig import Motion, Rig

RIGS = {
    "built well": RigParams(),
    "misregistered by 0.6°": RigParams(misregistration_deg=0.6),
    "depth 25 ms late": RigParams(lag_ms=25.0),
    "both": RigParams(misregistration_deg=0.6, lag_ms=25.0),
}
VIEW_STEP, NEAREST_M, FARTHEST_M = 4, 0.2, 4.0
SHOWN_DEG = 1.8  # in the picture
FIRST = 5  # frames before anything is remembered of a stream


def frames_of(sensor: str, rig: RigParams, seed: int, count: int, rate: float) -> Iterator[tuple[DepthImage, Array]]:
    """The pictures of a camera that is carried through a room, and the true rotation (3,) rad of depth upon colour."""
    name, depth = SENSORS[sensor]
    camera, plan = CAMERAS[name], make_plan("opposite", seed, count, rate)
    cameras, motion = Rig(rig, camera, seed), Motion(plan.T_world_camera, plan.rate)
    for k in range(count):
        seconds, scene = k / plan.rate, plan.scenes[int(plan.scene_of[k])]
        seen = cameras.take_picture(scene, motion, seconds, k, depth, threads=2)
        late = inverse(motion.at(seconds)) @ motion.at(seconds - 1e-3 * rig.lag_ms) @ cameras.T_colour_depth
        image = DepthImage(depth=seen.depth, rgb=seen.rgb, intrinsics=camera, stamp_ns=round(1e9 * seconds))
        yield image, vector_from_rotation(late[:3, :3])


def measured(sensor: str, rig: RigParams, seed: int, count: int, rate: float) -> dict[str, Any]:
    """What one stream shows, and the truth, frame by frame."""
    stream, found, true, noise = DepthToColour(), [], [], []  # what would be found of a stereo camera is not used
    estimate = SensorEstimate()
    for image, rotation in frames_of(sensor, rig, seed, count, rate):
        found.append(stream.offset(image).rotation)
        true.append(rotation)
        estimate.register(image)
        view = reduced_view(image, step_for(image.intrinsics, VIEW_STEP), NEAREST_M, FARTHEST_M)
        noise.append(depth_noise(np.nan_to_num(view.xyz[..., 2])))
    degrees = {"found": np.degrees(found[FIRST:]), "true": np.degrees(true[FIRST:])}
    off = np.linalg.norm(degrees["found"] - degrees["true"], axis=1)
    return {
        "off_deg": np.percentile(off, (50, 90)).tolist(),
        "true_deg": np.percentile(np.linalg.norm(degrees["true"], axis=1), (50, 90)).tolist(),
        "noise": np.percentile(noise, (10, 50, 90)).tolist(),
        "estimated_noise": estimate.noise,
        "true_lag_ms": rig.lag_ms,
        "lag": None if estimate.lag is None else estimate.lag._asdict(),
        **{name: value.tolist() for name, value in degrees.items()},
    }


def draw(rows: dict[str, dict[str, Any]], path: Path) -> None:
    """The offsets that were found over the true ones, a panel for each rig, a colour for each sensor."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, panels = pyplot.subplots(1, len(RIGS), figsize=(3.4 * len(RIGS), 4.2), sharex=True, sharey=True)
    for panel, rig in zip(panels, RIGS, strict=True):
        for sensor in SENSORS:
            row = rows[f"{sensor}, {rig}"]
            label = f"{sensor}, not used" if sensor == "realsense_d435" else sensor
            panel.plot(np.ravel(row["true"]), np.ravel(row["found"]), ".", markersize=4, label=label)
        panel.axline((0, 0), slope=1, color="grey", linewidth=0.8)
        panel.set(title=rig, xlabel="true offset about x, y, z [deg]", xlim=(-SHOWN_DEG, SHOWN_DEG))
        panel.set(ylim=(-SHOWN_DEG, SHOWN_DEG), aspect="equal")
    panels[0].set_ylabel("found in the frame [deg]")
    figure.tight_layout(rect=(0.0, 0.08, 1.0, 1.0))
    figure.legend(*panels[0].get_legend_handles_labels(), loc="lower center", ncols=len(SENSORS), frameon=False)
    figure.savefig(path, dpi=120)


@click.command()
@click.option("--frames", default=60, show_default=True, help="Pictures of each stream.")
@click.option("--rate", default=6.0, show_default=True, help="Of them, in Hz.")
@click.option("--seed", default=31, show_default=True)
@click.option("--json", "json_file", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
@click.option("--picture", type=click.Path(dir_okay=False, path_type=Path), help="Draw found over true offsets here.")
def main(frames: int, rate: float, seed: int, json_file: Path | None, picture: Path | None) -> None:
    """Compare what streams show of their sensor with the truth."""
    streams = [(f"{sensor}, {name}", sensor, rig) for sensor in SENSORS for name, rig in RIGS.items()]
    rows = {name: measured(sensor, rig, seed, frames, rate) for name, sensor, rig in tqdm(streams, unit="stream")}
    click.echo(
        f"{'stream':40} {'true offset':>16} {'found, off by':>16}   noise (median, 10 and 90 %)  true lag  found"
    )
    for name, row in rows.items():
        (true, true_90), (off, off_90), (low, noise, high) = row["true_deg"], row["off_deg"], row["noise"]
        offsets = f"{true:6.2f} (p90 {true_90:.2f}) {off:6.2f} (p90 {off_90:.2f})"
        found = "-" if row["lag"] is None else f"{row['lag']['ms']:.0f} +- {row['lag']['sigma_ms']:.0f} ms"
        lags = f"{row['true_lag_ms']:.0f} ms  {found}"
        click.echo(f"{name:40} {offsets}   {noise:.2f} ({low:.2f}, {high:.2f})  {lags}")
    if json_file is not None:
        json_file.write_text(json.dumps(rows))
    if picture is not None:
        draw(rows, picture)


if __name__ == "__main__":
    main()
