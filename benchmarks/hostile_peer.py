# SPDX-License-Identifier: Apache-2.0
"""Constraints of an honest camera beside a hostile peer: three nodes and a mapper, live, with and without it.

A simulated recording is played over and over into detector, segmenter, registrar and mapper of one robot, which
exchanges keyframes. The second time a peer on the same domain sends 50 messages a second: forged summaries, requests
and keyframes of the exchange, spoilt objects, views and constraints with stamps of its own, and calls of services. What
it takes to be the operator or the camera (``enable``, ``parameters``) comes where it is asked for: docs/security.md
says what that does without SROS 2. Printed is the share of the constraints that is left; all processes must live.

    python benchmarks/hostile_peer.py --seconds 600 --json hostile.json
"""

from __future__ import annotations

import json
import multiprocessing
import os
import random
import tempfile
import time
from array import array
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import click
from latency import recorded
from overload import Gauge, endless, unaccounted

from objreg_tools.cli.live import START_S, private_environment
from objreg_tools.cli.processes import Processes
from objreg_tools.recording import open_recording
from objreg_tools.recording.inputs import choose_inputs, parse_remaps
from objreg_tools.recording.replay import graph_names

ROBOT, FLEET = "honest", "/fleet"
NODES = "detector", "segmenter", "registrar", "mapper"
LEAST = 0.9  # share of the constraints that has to be left
KINDS = "exchange", "messages", "services", "enable", "parameters"
DEFAULT = "exchange,messages,services"
SETTLE_S = 10.0  # the last searches
KEPT = 50  # messages of the honest robot that the hostile one forges
STEP_NS = 100_000_000


def play(path: Path, seconds: float) -> None:
    """Play a recording over and over to the nodes of the robot, at the camera's rate."""
    import rclpy

    from objreg_ros.bridge.streams.player import Player

    with open_recording(path) as source:
        found = graph_names(source, choose_inputs(source.topics, parse_remaps(())))
        names = {topic: name if name.startswith("/") else f"/{ROBOT}/{name}" for topic, name in found.items()}
        messages = [(names[record.topic], record.stamp_ns, record.cdr) for record in source.records(set(names))]
        kinds = {out: source.topics[topic].msgtype for topic, out in names.items()}
    rclpy.init(args=[])
    player = Player(kinds)
    try:
        player.wait_for_listeners(names.values(), 30.0)
        player.play(endless(messages, seconds), 1.0, lambda item: None)
    finally:
        player.close()
        rclpy.try_shutdown()


class Peer:
    """Sends one hostile message after another."""

    def __init__(self, seed: int, kinds: tuple[str, ...]) -> None:
        import attacked_messages as good
        import attacked_peers as peers
        import rclpy
        from sensor_msgs.msg import CompressedImage
        from std_srvs.srv import SetBool, Trigger

        from objreg_ros.bridge.node import qos

        self._good, self._peers, self._draw = good, peers, random.Random(seed)
        self._node = rclpy.create_node("peer")
        self._publishers, self._stamp_ns = dict[str, Any](), 10 * good.SECOND
        side = peers.Side(peers.HONEST)
        self._said = {
            "summaries": (peers.SUMMARY, list(side.summaries)),
            "keyframes": (peers.DELIVERY, list(side.deliveries)),
            "requests": (peers.REQUEST, [peers.pack_request(peers.Request(peers.Name(peers.HONEST, 1), 9.0, "peer"))]),
        }
        for name in self._said:
            self._node.create_subscription(
                CompressedImage, f"{FLEET}/{name}", self._overhear(name), qos.stage(depth=50)
            )
        self._bomb = peers._deflated(bytes(peers.BOMB))
        self._triggers = {
            f"/{ROBOT}/{name}": self._node.create_client(Trigger, f"/{ROBOT}/{name}")
            for name in ("registrar/reset", "registrar/save", "mapper/save", "mapper/reset")
        }
        self._enable = [self._node.create_client(SetBool, f"/{ROBOT}/{name}/enable") for name in NODES]
        acts: dict[str, Callable[[], None]] = {
            "exchange": self._exchange, "messages": self._message, "services": self._call,
            "enable": self._disable, "parameters": self._set,
        }  # fmt: skip
        self._acts = [acts[kind] for kind in kinds]

    def act(self) -> None:
        """Send one message, and listen."""
        import rclpy
        from trials import NoTrialError

        with suppress(NoTrialError):
            self._draw.choice(self._acts)()
        rclpy.spin_once(self._node, timeout_sec=0.0)

    def _overhear(self, name: str) -> Callable[[Any], None]:
        def keep(message: Any) -> None:
            goods = self._said[name][1]
            goods.append(bytes(message.data))
            del goods[:-KEPT]

        return keep

    def _exchange(self) -> None:
        from sensor_msgs.msg import CompressedImage

        from objreg_ros.bridge.node import qos
        from objreg_ros.bridge.streams.exchanging import FORMAT

        name = self._draw.choice(list(self._said))
        kind, goods = self._said[name]
        try:
            packed = self._peers.forged(self._draw, self._peers.KINDS[kind], self._draw.choice(goods), self._bomb)
        except Exception:  # what was overheard is one of our own that is none
            return
        data = array("B")
        data.frombytes(packed)
        profile = qos.latched(qos.KEPT_SUMMARIES) if name == "summaries" else qos.stage(depth=100)
        self._publish(f"{FLEET}/{name}", CompressedImage(format=FORMAT, data=data), profile)

    def _message(self) -> None:
        from objreg_ros.bridge.node import qos

        self._stamp_ns += STEP_NS
        objects, view, info, _, _ = self._good.frame_messages(self._good.drawn_frame(self._stamp_ns))
        tie = self._good.constraint_message(self._stamp_ns - 20 * STEP_NS, self._stamp_ns, x=0.2)
        topic, message = self._draw.choice(
            (("objects", objects), ("view", view), ("view/camera_info", info), ("constraints", tie))
        )
        profile = qos.latched(qos.KEPT_CONSTRAINTS) if topic == "constraints" else qos.stage()
        self._publish(f"/{ROBOT}/{topic}", self._good.spoilt(self._draw, message), profile)

    def _publish(self, topic: str, message: Any, profile: Any) -> None:
        if topic not in self._publishers:
            self._publishers[topic] = self._node.create_publisher(type(message), topic, profile)
        self._publishers[topic].publish(message)

    def _call(self) -> None:
        from std_srvs.srv import Trigger

        name = self._draw.choice(list(self._triggers))
        if self._triggers[name].service_is_ready():
            self._triggers[name].call_async(Trigger.Request())

    def _disable(self) -> None:
        from std_srvs.srv import SetBool

        client = self._draw.choice(self._enable)
        if client.service_is_ready():
            client.call_async(SetBool.Request(data=False))

    def _set(self) -> None:
        from rcl_interfaces.srv import SetParameters
        from rclpy.parameter import Parameter

        client = self._node.create_client(SetParameters, f"/{ROBOT}/detector/set_parameters")
        if client.service_is_ready():
            value = self._draw.choice((0.0, 1.0, float("inf"), -1.0))
            client.call_async(
                SetParameters.Request(parameters=[Parameter("threshold", value=value).to_parameter_msg()])
            )


def attack(kinds: tuple[str, ...], hz: float, seconds: float, sent: Any) -> None:
    """Be the hostile peer for so long; ``sent`` counts its messages."""
    import rclpy

    rclpy.init(args=[])
    peer, start = Peer(0, kinds), time.monotonic()
    while (now := time.monotonic()) < start + seconds:
        peer.act()
        sent.value += 1
        time.sleep(max(0.0, start + sent.value / hz - now))


def measure(path: Path, seconds: float, kinds: tuple[str, ...], hz: float, folder: Path) -> dict[str, Any]:
    """One run, with a hostile peer if there are kinds of what it does."""
    environment = private_environment()
    os.environ.update(environment)
    with ExitStack() as stack:
        processes, gauge = stack.enter_context(Processes(folder, environment)), Gauge()
        stack.callback(gauge.close)
        for name in NODES:
            more = {"registrar": ["-p", f"exchange:={FLEET}", "-p", f"store:={folder}/place.db"]}
            more["mapper"] = ["-p", f"graph_path:={folder}/map.g2o"]
            own = ["--ros-args", "-r", f"__ns:=/{ROBOT}", *more.get(name, [])]
            processes.start(name, "objreg_mapper.node" if name == "mapper" else f"objreg_ros.{name}.node", own)
        _wait_for_nodes(gauge, processes)
        context = multiprocessing.get_context("spawn")
        sent = context.Value("q", 0)
        if kinds:
            peer = context.Process(target=attack, args=(kinds, hz, seconds + 60.0, sent), daemon=True)
            peer.start()
            stack.callback(peer.kill)
            _wait(lambda: sent.value > 0, processes, "the hostile peer")
        play(path, seconds)
        time.sleep(SETTLE_S)
        processes.require_alive()
        said = {name: dict(gauge.latest[f"{ROBOT}/{name}"]) for name in NODES}
    return {
        "constraints": int(said["registrar"]["constraints"]),
        "frames": int(said["registrar"]["published"]),
        "hostile": int(sent.value),
        "unaccounted": {name: unaccounted(said[name]) for name in NODES},
        "registrar": said["registrar"],
    }


def _wait_for_nodes(gauge: Gauge, processes: Processes) -> None:
    wanted = {f"{ROBOT}/{name}" for name in NODES}
    _wait(lambda: wanted <= gauge.latest.keys(), processes, ", ".join(sorted(wanted)))


def _wait(done: Callable[[], bool], processes: Processes, what: str) -> None:
    deadline = time.monotonic() + START_S
    while not done():
        processes.require_alive()
        if time.monotonic() > deadline:
            raise click.ClickException(f"expected {what} within {START_S:.0f} s, got none")
        time.sleep(0.2)


def ratio_of(without: Mapping[str, Any], beside: Mapping[str, Any]) -> float:
    """The share of the constraints that is left beside a hostile peer. ClickException where there were none before."""
    if not without["constraints"]:
        raise click.ClickException("expected constraints without a hostile peer, got none; play longer")
    return float(beside["constraints"] / without["constraints"])


def _kinds(_: click.Context, __: click.Parameter, text: str) -> tuple[str, ...]:
    kinds = tuple(text.split(","))
    if set(kinds) - set(KINDS):
        raise click.BadParameter(f"expected some of {','.join(KINDS)}, got {text!r}")
    return kinds


@click.command(help=__doc__)
@click.option("--seconds", default=600.0, show_default=True, help="How long to play, each time.")
@click.option("--hz", default=50.0, show_default=True, help="Messages a second of the hostile peer.")
@click.option("--what", callback=_kinds, default=DEFAULT, show_default=True, help="What it does, by commas.")
@click.option("--frames", default=300, show_default=True, help="Frames of the recording that is played over and over.")
@click.option("--json", "out", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
def main(seconds: float, hz: float, what: tuple[str, ...], frames: int, out: Path | None) -> None:
    """Measure with and without, and print the ratio."""
    with tempfile.TemporaryDirectory() as folder, recorded(4, frames, 0) as path:
        without = measure(path, seconds, (), hz, Path(folder) / "without")
        beside = measure(path, seconds, what, hz, Path(folder) / "beside")
    ratio = ratio_of(without, beside)
    for name, run in (("without", without), ("beside a hostile peer", beside)):
        numbers = ", ".join(f"{run[key]} {key}" for key in ("constraints", "frames", "hostile"))
        click.echo(f"{name:22} {numbers}, unaccounted {run['unaccounted']}")
    click.echo(f"ratio of constraints: {ratio:.2f}, at least {LEAST} is wanted")
    if out is not None:
        out.write_text(json.dumps({"ratio": ratio, "without": without, "beside": beside}, indent=1) + "\n")
    raise SystemExit(0 if ratio >= LEAST else 1)


if __name__ == "__main__":
    main()
