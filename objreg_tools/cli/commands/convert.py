# SPDX-License-Identifier: Apache-2.0
"""`objreg convert`: any recording as rosbag2."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import click
from tqdm import tqdm

from objreg_tools.cli import options
from objreg_tools.cli.paths import OutputPath
from objreg_tools.recording import Record, Recording, open_recording, write_rosbag2
from objreg_tools.recording.rosbag.writer import STORAGES


@click.command()
@options.recording
@click.argument("out", type=OutputPath(path_type=Path))
@click.option(
    "--storage", type=click.Choice(list(STORAGES)), default="mcap", show_default=True, help="The kind of files in OUT."
)
def command(recording: Path, out: Path, storage: str) -> None:
    """Write RECORDING (rosbag1, rosbag2 or a TUM RGB-D folder) as the rosbag2 folder OUT.

    The topics keep the QoS of their publishers; what ROS 1 latched becomes transient local. Topics of a type that ROS 2
    does not ship, or not with the same fields, or whose name it does not allow, are left out and listed;
    so are topics without messages.
    """
    with open_recording(recording) as source:
        for note in source.notes:
            click.echo(f"! {note}", err=True)
        silent = {topic.name: "no messages" for topic in source.topics.values() if not topic.count}
        obstacles = {**silent, **source.obstacles()}
        for name, reason in obstacles.items():
            click.echo(f"left out: {name} ({reason})", err=True)
        kept = _with_progress(source, set(source.topics) - set(obstacles))
        count = write_rosbag2(out, kept, storage, source.offered_qos())
    click.echo(f"{out}: {count} records")


def _with_progress(source: Recording, topics: set[str]) -> Iterator[Record]:
    total = sum(source.topics[name].count for name in topics)
    yield from tqdm(source.records(topics), total=total, unit="record", disable=None, leave=False)
