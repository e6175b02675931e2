# SPDX-License-Identifier: Apache-2.0
"""`objreg replay`: a recording into the live graph."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click
from tqdm import tqdm

from objreg_ros.bridge.streams.acknowledgements import DEPTH, IMAGE, Acknowledgements
from objreg_tools.cli import NOTHING, options
from objreg_tools.cli.run_output import notify
from objreg_tools.recording import Recording, open_recording
from objreg_tools.recording.camera_from_text import with_camera
from objreg_tools.recording.inputs import SOURCES, Inputs, choose_inputs, parse_remaps
from objreg_tools.recording.mounts import TRANSFORMS, first_frames, static_topics
from objreg_tools.recording.replay import Selection, graph_names, read_ahead, recorded_names
from objreg_tools.recording.rosbag.messages import header_stamp_ns
from objreg_tools.recording.tf_odometry import with_transforms
from objreg_tools.recording.troubles import troubles

if TYPE_CHECKING:
    from objreg_ros.bridge.streams.player import PlayedMessage, Player

LISTEN = (
    "start the nodes with `objreg_graph`, or play to the names that they have, "
    "as with `objreg replay REC -- --ros-args -r __ns:=/ROBOT -r image:=/camera/rgb`"
)


@click.command()
@options.recording
@click.option("--rate", type=click.FloatRange(min=0, min_open=True), default=1.0, show_default=True, help="Speed.")
@click.option("--loop", is_flag=True, help="Start over at the end, with the same stamps.")
@click.option("--clock", is_flag=True, help="Publish /clock (for nodes with use_sim_time).")
@click.option("--start", type=click.FloatRange(min=0), default=0.0, help="Seconds of the recording to skip.")
@click.option("--end", type=click.FloatRange(min=0), help="Seconds of the recording at which to end.")
@click.option("--lossless", is_flag=True, help="Wait for the nodes at every frame, so that none is lost.")
@click.option("--all", "everything", is_flag=True, help="Every topic under its own name, not only the graph's inputs.")
@click.option("--wait", type=click.FloatRange(min=0), default=10.0, show_default=True, help="Seconds for subscribers.")
@click.option(
    "--patience",
    type=click.FloatRange(min=0),
    default=300.0,
    show_default=True,
    help="Seconds for one frame if lossless.",
)
@options.remap
@options.camera
@click.option(
    "--source", "depth_source", type=click.Choice(SOURCES), default="auto", help="Which depth, as segmenter.source."
)
@click.argument("ros_args", nargs=-1, type=click.UNPROCESSED)
def command(
    recording: Path,
    rate: float,
    loop: bool,
    clock: bool,
    start: float,
    end: float | None,
    lossless: bool,
    everything: bool,
    wait: float,
    patience: float,
    remaps: tuple[str, ...],
    camera: str,
    depth_source: str,
    ros_args: tuple[str, ...],
) -> int:
    """Publish RECORDING under the names that the nodes subscribe to.

    With --all, topics of a type that is not installed here, or that ROS 2 has with other fields, or whose name it does
    not allow, are left out and listed. Arguments behind -- go to ROS, like -- --ros-args -r __ns:=/robot.
    With --lossless it ends with 3 if no frame got through.
    """
    from objreg_ros.bridge.process import profile
    from objreg_ros.bridge.process.lifetime import begin, shutdown_as_interrupt
    from objreg_ros.bridge.streams.player import Player

    asked = parse_remaps(remaps)
    with open_recording(recording) as opened:
        source = with_transforms(with_camera(opened, camera, asked, depth_source))
        for note in source.notes:
            click.echo(f"! {note}", err=True)
        inputs = choose_inputs(source.topics, asked, depth_source, first_frames(source))
        notify(troubles(source, inputs), err=True)
        names = playable_names(source, inputs) if everything else {**graph_names(source, inputs), **_mounts(source)}
        if not names:
            raise ValueError(f"{recording}: expected topics that the graph can use, got {', '.join(source.topics)}")
        selection = Selection(names, start, end)
        selection.require_some(source)
        click.echo(profile.apply(), err=True)
        begin(ros_args)
        latched = {names[topic] for topic in source.latched.keys() & names.keys()}
        kinds = {out: source.topics[topic].msgtype for topic, out in names.items()}
        with shutdown_as_interrupt(), _begun(Player(kinds, clock, latched)) as player:
            _prepare(player, inputs, names, wait)
            acknowledgements = player.subscribe_to_acknowledgements(wait) if lossless else None
            again = True
            with _reported_at_the_end(player, acknowledgements):
                while again:
                    _play_once(
                        player, source, selection, inputs, None if lossless else rate, acknowledgements, patience
                    )
                    again = loop
    return _exit_code(acknowledgements)


def _exit_code(acknowledgements: Acknowledgements | None) -> int:
    """`NOTHING` where the last node that acknowledges frames published none; 0 without acknowledgements."""
    if acknowledgements is None or acknowledgements.outcomes[acknowledgements.nodes[-1]]["published"]:
        return 0
    click.echo(f"! no frame got through the {acknowledgements.nodes[-1]}; docs/troubleshooting.md#no-frame-got-through")
    return NOTHING


@contextmanager
def _begun(player: Player) -> Iterator[Player]:
    """The player, closed at the end, and ROS with it."""
    import rclpy

    try:
        yield player
    finally:
        player.close()
        rclpy.try_shutdown()


def _mounts(source: Recording) -> dict[str, str]:
    """The recording's /tf_static, which gives the mounting of camera and IMU, where its type is installed."""
    from objreg_ros.bridge.streams.player import is_installed

    return {topic: "/tf_static" for topic in static_topics(source)[:1] if is_installed(TRANSFORMS)}


def playable_names(source: Recording, inputs: Inputs) -> dict[str, str]:
    """Every topic that can be published, under its own name; the others are listed for the user.

    ValueError where one of those is an input of the graph.
    """
    obstacles = _obstacles(source)
    needed = sorted(obstacles.keys() & set(inputs.chosen().values()))
    if needed:
        reasons = ", ".join(f"{name} ({obstacles[name]})" for name in needed)
        raise ValueError(
            f"expected inputs that can be published, got {reasons}; choose others with --remap input:=/topic"
        )
    for name, reason in obstacles.items():
        click.echo(f"left out: {name} ({reason})", err=True)
    return {topic: name for topic, name in recorded_names(source).items() if topic not in obstacles}


def _obstacles(source: Recording) -> dict[str, str]:
    """The topics that cannot be published here, each with the reason. The bytes of a rosbag2 go out as they are."""
    from objreg_ros.bridge.streams.player import is_installed

    absent = {t.name: f"{t.msgtype} is not installed" for t in source.topics.values() if not is_installed(t.msgtype)}
    return {**absent, **source.obstacles(shipped_only=False)}


def _prepare(player: Player, inputs: Inputs, names: dict[str, str], wait: float) -> None:
    needed = [names[topic] for topic in (inputs.image, inputs.depth or inputs.points) if topic in names]
    alone = player.wait_for_listeners(needed, wait)
    for topic in alone:
        click.echo(f"nobody listens to {topic}", err=True)
    if alone:
        click.echo(f"next: {LISTEN}", err=True)
    if inputs.missing:
        click.echo(f"the graph waits for {inputs.missing}, which this replay does not send", err=True)


def _play_once(
    player: Player,
    source: Recording,
    selection: Selection,
    inputs: Inputs,
    rate: float | None,
    acknowledgements: Acknowledgements | None,
    patience: float,
) -> None:
    items = read_ahead(_items(source, selection, inputs))
    with tqdm(total=selection.count(source), unit="message", disable=None, leave=False) as bar:
        if acknowledgements is None:
            player.play(items, rate, lambda item: _advance(bar))
        else:
            player.play_lossless(items, patience, lambda item: _advance(bar))


def _advance(bar: tqdm) -> None:
    bar.update(1)


def _items(source: Recording, selection: Selection, inputs: Inputs) -> Iterator[PlayedMessage]:
    from objreg_ros.bridge.streams.player import PlayedMessage

    kinds = {inputs.image: IMAGE, inputs.depth: DEPTH, inputs.points: DEPTH}
    for record in selection.records(source):
        name, kind = selection.names[record.topic], kinds.get(record.topic, "")
        cdr = record.cdr
        yield PlayedMessage(name, record.stamp_ns, cdr, kind, header_stamp_ns(cdr) if kind else 0)


@contextmanager
def _reported_at_the_end(player: Player, acknowledgements: Acknowledgements | None) -> Iterator[None]:
    """Reports what was sent, also where a signal ends the play."""
    from objreg_ros.bridge.process.lifetime import shutdown_as_interrupt

    try:
        with shutdown_as_interrupt():
            yield
    except (KeyboardInterrupt, SystemExit):
        _say(player, acknowledgements)
        raise
    _say(player, acknowledgements)


def _say(player: Player, acknowledgements: Acknowledgements | None) -> None:
    for topic, count in sorted(player.published.items()):
        click.echo(f"{count} {topic}")
    if acknowledgements is not None:
        for node, outcomes in acknowledgements.outcomes.items():
            click.echo(f"{node}: " + ", ".join(f"{count} {verdict}" for verdict, count in sorted(outcomes.items())))
    if player.lost:
        click.echo(f"{len(player.lost)} frames without an acknowledgement, the first of {player.lost[0]} ns")
