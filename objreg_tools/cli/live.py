# SPDX-License-Identifier: Apache-2.0
"""A recording through the live graph: node processes, a player process, and a subscriber in this one."""

from __future__ import annotations

import os
import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from objreg_ros.bridge.node.accounting import Balance
from objreg_ros.data.closures import LoopClosure, Rejected
from objreg_tools.cli.processes import Processes
from objreg_tools.cli.verbosity import is_quiet, is_verbose

if TYPE_CHECKING:
    from objreg_ros.bridge.streams.collector import Collector, LastDetections

STAGES = ("detector", "segmenter", "registrar")
START_S = 120.0  # on a machine that may be busy
DRAIN_S = 120.0  # the last searches
QUIET_S = 3.0  # no counter moved for so long: all is through


@dataclass(frozen=True, slots=True)
class Live:
    """The results of the live graph; ``counters`` by node, ``glimpses`` as in `offline`, without poses."""

    counters: Mapping[str, Balance]
    rejected: Mapping[str, int]
    closures: tuple[LoopClosure, ...]
    sight: LastDetections | None = None
    refusals: tuple[Rejected, ...] = ()
    glimpses: tuple[Mapping[str, Any], ...] = ()


@dataclass(frozen=True, slots=True)
class Setup:
    """How the graph is started: ROS arguments of each node, the player's options, and whether in one process.

    ``programs`` has the module, and the arguments before all others, of a process that is started by another one.
    """

    node_args: Mapping[str, Sequence[str]] = field(default_factory=dict)
    replay_args: Sequence[str] = ()
    composed: bool = False
    programs: Mapping[str, Sequence[str]] = field(default_factory=dict)


def run_live(recording: Path, setup: Setup, folder: Path, say: Callable[[str], None]) -> Live:
    """Play a recording through the graph on a ROS domain of its own; ValueError if a process fails."""
    environment = private_environment()
    with Processes(folder, environment) as processes, _listening(environment) as collector:
        for name, module, arguments in _programs(setup):
            started, *before = setup.programs.get(name, (module,))
            processes.start(name, started, [*before, *arguments], quiet=not is_verbose())
        say("starting three nodes")
        _wait_for_nodes(collector, processes)
        say("playing")
        arguments_of_player = ["replay", str(recording), *setup.replay_args]
        player = processes.start("player", "objreg_tools.cli", arguments_of_player, quiet=is_quiet())
        collector.spin_until(lambda: player.poll() is not None, float("inf"))
        processes.require_alive()
        say("waiting for the last frames")
        _drain(collector)
        counters = {name.strip("/"): balance for name, balance in collector.counters.items()}
        glimpses = tuple(glimpse for _, glimpse in sorted(collector.glimpses.items()))
        closures, refusals = tuple(collector.closures), tuple(collector.refusals)
        return Live(counters, collector.rejected, closures, collector.sight, refusals, glimpses)


def _programs(setup: Setup) -> list[tuple[str, str, list[str]]]:
    """The processes to start: the name of the log, the module and the arguments of each."""
    arguments = {node: list(setup.node_args.get(node, ())) for node in STAGES}
    if setup.composed:
        own = [_addressed(node, argument) for node in STAGES for argument in arguments[node]]
        return [("graph", "objreg_tools.graph", ["--ros-args", *own] if own else [])]
    return [(node, f"objreg_ros.{node}.node", ["--ros-args", *own] if own else []) for node, own in arguments.items()]


def _addressed(node: str, argument: str) -> str:
    """A parameter or remap for one of several nodes of a process."""
    return f"{node}:{argument}" if ":=" in argument else argument


def private_environment() -> dict[str, str]:
    """This process's environment with the DDS profile, and a domain of its own unless the user named one."""
    from objreg_ros.bridge.process import profile

    environment = dict(os.environ)
    profile.apply(environment)
    environment.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    environment.setdefault("ROS_DOMAIN_ID", str(random.randint(1, 100)))
    return environment


@contextmanager
def _listening(environment: Mapping[str, str]) -> Iterator[Collector]:
    """The collector for the time of a with block."""
    os.environ.update(environment)  # DDS reads it here
    from rclpy.context import Context

    from objreg_ros.bridge.streams.collector import Collector
    from objreg_tools.offline.outlines import outline

    context = Context()
    context.init(args=[])  # not the command line: its --remap is not for ROS
    collector = Collector(context, outline)
    try:
        yield collector
    finally:
        collector.close()
        context.try_shutdown()


def _wait_for_nodes(collector: Collector, processes: Processes) -> None:
    def there() -> bool:
        processes.require_alive()
        return {f"/{node}" for node in STAGES} <= set(collector.counters)

    if not collector.spin_until(there, START_S):
        raise ValueError(
            f"expected {', '.join(STAGES)} to report within {START_S:.0f} s, got {sorted(collector.counters)}"
        )


def _drain(collector: Collector) -> None:
    """Until no counters move any more; then the registrar ends the keyframe in hand."""
    while collector.spin_until(_movement(collector), _patience(collector)):
        pass
    collector.call("registrar/save", DRAIN_S)
    collector.spin_until(_movement(collector), QUIET_S)


def _movement(collector: Collector) -> Callable[[], bool]:
    state = _state(collector)
    return lambda: _state(collector) != state


def _state(collector: Collector) -> Any:
    return {name: (counters.published, counters.dropped) for name, counters in collector.counters.items()}


def _patience(collector: Collector) -> float:
    """A frame that is worked on may take long; one that waits for a partner may wait for ever."""
    working = any(collector.counters[f"/{node}"].waiting for node in ("detector", "registrar"))
    return DRAIN_S if working else QUIET_S
