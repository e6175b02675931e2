# SPDX-License-Identifier: Apache-2.0
"""Which recording a demo plays, as a rosbag2."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path

import click
from tqdm import tqdm

from objreg_tools.recording import open_recording, write_rosbag2
from objreg_tools.recording.inputs import Inputs
from objreg_tools.recording.mounts import static_topics

SCENARIO, SEED, FRAMES, RATE_HZ = "loop", 1, 600, 30.0


def simulated_room(out: Path) -> Path:
    """A simulated room to leave and come back to, with exact truth; made once."""
    from objreg_tools.cli.commands.simulate import camera_of, sensors_of
    from objreg_tools.simulation.write import simulate

    bag = out / f"simulated_{SCENARIO}_{SEED}"
    if not bag.exists():
        bar = tqdm(total=FRAMES, unit="frame", desc="simulating a room", disable=None)
        with bar, _whole(bag) as unfinished:
            sensors = sensors_of(camera_of("kinect", None), stress=False, settings=())
            simulate(unfinished, SCENARIO, SEED, FRAMES, RATE_HZ, sensors, progress=lambda n: bar.update(n - bar.n))
    return bag


def as_rosbag2(recording: Path, inputs: Inputs, out: Path, seconds: float | None) -> Path:
    """The recording itself if it is a rosbag2, else a copy of the first ``seconds`` of its inputs as one, made once."""
    with open_recording(recording) as source:
        topics = {*(set(inputs.chosen().values()) & source.topics.keys()), *static_topics(source)}
        if source.kind.startswith("rosbag2"):
            return recording
        part = "" if seconds is None else f"_{seconds:g}s"
        bag = out / f"{source.path.resolve().name.removesuffix('.bag')}{part}_{_mark(source.path, topics, out)}"
        if bag.exists():
            click.echo(f"playing {bag}, which an earlier run wrote of {recording}", err=True)
            return bag
        click.echo(f"writing {recording} as {bag}", err=True)
        end_ns = None if seconds is None else source.start_ns + round(seconds * 1e9)
        with _whole(bag) as unfinished:
            write_rosbag2(unfinished, source.records(topics, end_ns=end_ns), offered_qos=source.offered_qos())
    return bag


def _mark(recording: Path, topics: Iterable[str], out: Path) -> str:
    """Eight digits that change with the place, the bytes and the time of a recording, and with what is taken of it.

    Files that this command writes to ``out`` do not count, should it lie in the recording's folder.
    """
    place, own = recording.resolve(), out.resolve()
    files = [place] if place.is_file() else [file for file in place.rglob("*") if file.is_file()]
    stats = [file.stat() for file in files if own not in file.parents or own == place]
    identity = (str(place), sum(s.st_size for s in stats), max(s.st_mtime_ns for s in stats), sorted(topics))
    return sha256(repr(identity).encode()).hexdigest()[:8]


@contextmanager
def _whole(bag: Path) -> Iterator[Path]:
    """Where it is written until it is whole; a failure leaves nothing."""
    bag.parent.mkdir(parents=True, exist_ok=True)
    unfinished = bag.with_name(f"{bag.name}.{os.getpid()}")
    try:
        yield unfinished
    except BaseException:
        shutil.rmtree(unfinished, ignore_errors=True)
        raise
    unfinished.rename(bag)
