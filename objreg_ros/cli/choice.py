# SPDX-License-Identifier: Apache-2.0
"""Which recording a demo plays, as a rosbag2, and with which detector."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import click
from tqdm import tqdm

from objreg_ros import share
from objreg_ros.recording import open_recording, write_rosbag2

KITCHEN, COCO = "data/redkitchen_a", "models/ssd_mobilenet_v1_coco_int8.onnx"
COCO_ARGS = ("-p", "threshold:=0.4")  # the scores of the quantised model are low
SCENARIO, SEED, FRAMES, RATE_HZ = "loop", 1, 600, 30.0


@dataclass(frozen=True, slots=True)
class Choice:
    """What is played, and the ROS arguments of its detector."""

    recording: Path
    detector_args: Sequence[str] = ()


def best_at_hand(out: Path) -> Choice:
    """Real frames if they lie beside the checkout (or in OBJREG_SHARED), else a simulated room, made once."""
    folder = Path(os.environ.get("OBJREG_SHARED", next(share.folders()).parent / "shared"))
    kitchen, model = folder / KITCHEN, folder / COCO
    if kitchen.is_dir() and model.is_file():
        return Choice(kitchen, ("-p", f"model:={model}", *COCO_ARGS))
    return Choice(_simulated(out / f"simulated_{SCENARIO}_{SEED}"))


def _simulated(bag: Path) -> Path:
    from objreg_ros.cli.simulate import camera_of, sensors_of
    from objreg_ros.simulation.write import simulate

    if not bag.exists():
        unfinished = _unfinished(bag)
        with tqdm(total=FRAMES, unit="frame", desc="simulating a room", disable=None) as bar:
            sensors = sensors_of(camera_of("kinect", None), stress=False, settings=())
            simulate(unfinished, SCENARIO, SEED, FRAMES, RATE_HZ, sensors, progress=lambda n: bar.update(n - bar.n))
        unfinished.rename(bag)
    return bag


def as_rosbag2(recording: Path, out: Path, seconds: float | None) -> Path:
    """The recording itself if it is a rosbag2, else a copy of its first ``seconds`` as one, made once."""
    with open_recording(recording) as source:
        if source.kind.startswith("rosbag2"):
            return recording
        part = "" if seconds is None else f"_{seconds:g}s"
        bag = out / f"{recording.resolve().stem}{part}"
        if not bag.exists():
            click.echo(f"writing {recording} as {bag}", err=True)
            end_ns = None if seconds is None else source.start_ns + round(seconds * 1e9)
            unfinished = _unfinished(bag)
            write_rosbag2(unfinished, source.records(end_ns=end_ns))
            unfinished.rename(bag)
    return bag


def _unfinished(bag: Path) -> Path:
    """Where it is written until it is whole."""
    bag.parent.mkdir(parents=True, exist_ok=True)
    return bag.with_name(f"{bag.name}.{os.getpid()}")
