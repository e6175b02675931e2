# SPDX-License-Identifier: Apache-2.0
"""Several robots in the same rooms: which meetings are tied, how many ties are false, and how true one map of all is.

    python benchmarks/robots.py FOLDER… --json robots.json
    python benchmarks/robots.py --simulate 1,2 --json robots.json

A FOLDER holds a recording for each robot, as `objreg simulate --scenario robots` writes them. ``one registrar`` takes
all frames by their stamps; ``packed`` takes the keyframes that each robot made, packed to be sent and unpacked; of
``each its own`` every robot has a registrar, which asks for what the summaries of others promise (``--kilobytes`` a
second; ``kB_per_s`` is what it sent from its first frame to the last of all). Meetings are as `fleet` finds them.
``map_cm`` is the error of one map of all robots (aligned once), of the map with the same closures and perfect ties
between robots, and of odometry; ``alone_cm`` that of each robot's own map.
"""

from __future__ import annotations

import heapq
import json
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import click
import fleet
import numpy as np
from closers import TOLERANCE_NS, keyframes_of, perfect
from map_limits import kept
from sources import SIMULATED, detector_of, read_source
from tqdm import tqdm

from objreg_mapper.pose_graph import PoseGraph
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.data.frames import Frame, Odometry
from objreg_ros.geometry import inverse
from objreg_ros.keyframes.frame_window import Arrival
from objreg_ros.keyframes.fusion import fuse
from objreg_ros.keyframes.keyframer import Keyframer
from objreg_ros.memory.compact import pack_keyframe, unpack_keyframe
from objreg_ros.registrar.exchange import Exchange
from objreg_ros.registrar.outcome import Outcome
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.registrar import Registrar
from objreg_tools.report.run.revisits import SeenPlace
from objreg_tools.report.run.trajectory_error import absolute_trajectory_error
from objreg_tools.simulation.write import simulate_fleet
from objreg_tools.truth import FALSE, Truth, Truths, within

PARAMS = RegistrarParams(seed=1).replaced(**SIMULATED)
SEED = 1


@dataclass(frozen=True)
class Robot:
    """What a robot saw, and where it was."""

    frames: list[Frame]
    truth: Truth


Team = Mapping[str, Robot]
Way = Callable[[Team], "tuple[list[LoopClosure], dict[str, Any]]"]


def team_of(folder: Path, keep: Path, model: str) -> Team:
    """The robots of a folder; frames out of a file where they were made before."""
    paths = sorted(path for path in folder.iterdir() if path.is_dir())
    return {path.name: kept(path, keep / (model or "own"), partial(_robot, path, model)) for path in paths}


def _robot(path: Path, model: str) -> Robot:
    click.echo(f"{path}: detecting and segmenting", err=True)
    with read_source(path, detector_of(model), SEED) as source:
        return Robot([replace(frame, robot=path.name) for frame in source.frames], source.truth)


def in_order(team: Team) -> Iterator[Frame]:
    """The frames of all robots by their stamps."""
    return heapq.merge(*(robot.frames for robot in team.values()), key=lambda frame: frame.stamp_ns)


def one_registrar(team: Team) -> tuple[list[LoopClosure], dict[str, Any]]:
    """All frames into one registrar."""
    registrar, closures = Registrar(PARAMS), list[LoopClosure]()
    for frame in tqdm(list(in_order(team)), desc="one registrar"):
        closures += registrar.process(frame).closures
    closures += registrar.finish().closures
    counts = registrar.counts()
    registrar.close()
    return closures, {"keyframes": counts["keyframes"]}


def arrivals(team: Team) -> Iterator[Arrival]:
    """The keyframes that each robot makes, in the order in which they are ready."""
    keyframers = {name: Keyframer(PARAMS) for name in team}
    for frame in in_order(team):
        window = keyframers[frame.robot].add_frame(frame)
        if window is not None:
            yield Arrival(fuse(window, PARAMS), window.clock, frame.robot)
    for name, keyframer in keyframers.items():
        if (window := keyframer.finish_window()) is not None:
            yield Arrival(fuse(window, PARAMS), window.clock, name)


def packed(team: Team) -> tuple[list[LoopClosure], dict[str, Any]]:
    """All keyframes into one registrar, as they come over the air."""
    registrar, closures, sizes = Registrar(PARAMS), list[LoopClosure](), list[int]()
    for arrival in tqdm([one for one in arrivals(team) if one.keyframe.objects], desc="packed"):
        data = pack_keyframe(arrival.keyframe)
        sizes.append(len(data))
        came = replace(unpack_keyframe(data), robot=arrival.keyframe.robot)
        outcome = registrar.receive_keyframe(arrival._replace(keyframe=came))
        closures += () if outcome is None else outcome.closures
    closures += registrar.settle().closures
    registrar.close()
    p50, p95, most = np.percentile(sizes, (50, 95, 100)).tolist()
    return closures, {"keyframes": len(sizes), "bytes": {"p50": p50, "p95": p95, "most": most}}


class Peers:
    """A registrar for each robot; what one says all others receive at once. ``now`` is of the frames, in s."""

    def __init__(self, team: Team, bytes_per_second: float) -> None:
        self.registrars = {name: Registrar(PARAMS) for name in team}
        self.exchanges = {
            name: Exchange(registrar, name, bytes_per_second, run=name) for name, registrar in self.registrars.items()
        }
        self.closures = list[LoopClosure]()
        self.sizes = list[int]()  # of summaries

    def publish(self, name: str, outcome: Outcome, now: float) -> None:
        """What a robot's search came to, and its summary to all others."""
        self.closures += outcome.closures
        summary = self.exchanges[name].announce(outcome)
        if summary is None:
            return
        self.sizes.append(len(summary))
        for other in self._others(name):
            if (request := other.receive_summary(summary)) is not None:
                self.exchanges[name].note(request, now)

    def answer(self, now: float) -> None:
        """All that may be sent now."""
        for name, exchange in self.exchanges.items():
            while (packed := exchange.answer(now)) is not None:
                outcomes = [other.receive_delivery(packed) for other in self._others(name)]
                self.closures += [c for outcome in outcomes if outcome is not None for c in outcome.closures]

    def _others(self, name: str) -> list[Exchange]:
        return [exchange for other, exchange in self.exchanges.items() if other != name]


def each_its_own(team: Team, kilobytes: float) -> tuple[list[LoopClosure], dict[str, Any]]:
    """A registrar for each robot, which exchange what looks alike; 0 kilobytes a second are no limit."""
    peers, now = Peers(team, 1e3 * kilobytes if kilobytes else np.inf), 0.0
    for frame in tqdm(list(in_order(team)), desc="each its own"):
        now = 1e-9 * frame.stamp_ns
        peers.publish(frame.robot, peers.registrars[frame.robot].process(frame), now)
        peers.answer(now)
    for name, registrar in peers.registrars.items():
        peers.publish(name, registrar.finish(), now)
    peers.answer(now)
    for registrar in peers.registrars.values():
        peers.closures += registrar.settle().closures
        registrar.close()
    return peers.closures, {
        "summary_bytes": dict(zip(("p50", "most"), np.percentile(peers.sizes, (50, 100)).tolist(), strict=True)),
        "kB_per_s": {
            name: 1e-3 * exchange.counters["bytes sent"] / (now - 1e-9 * team[name].frames[0].stamp_ns)
            for name, exchange in peers.exchanges.items()
        },
        "counters": {name: dict(sorted(exchange.counters.items())) for name, exchange in peers.exchanges.items()},
        "waiting": {name: exchange.waiting for name, exchange in peers.exchanges.items()},
    }


def in_common(moments: Sequence[Sequence[Any]], others: Sequence[Sequence[Any]]) -> dict[str, int]:
    """How many closures between robots join moments that one of the ``others`` joins too, within `TOLERANCE_NS`."""

    def ends(moment: Sequence[Any]) -> list[tuple[str, int]]:
        return sorted(zip(moment[:2], moment[2:], strict=True))

    def alike(one: Sequence[Any], other: Sequence[Any]) -> bool:
        pairs = zip(ends(one), ends(other), strict=True)
        return all(a == b and abs(s - t) <= TOLERANCE_NS for (a, s), (b, t) in pairs)

    between = [moment for moment in moments if moment[0] != moment[1]]
    return {"common": sum(any(alike(one, other) for other in others) for one in between), "of": len(between)}


WAYS: dict[str, Way] = {"one registrar": one_registrar, "packed": packed}
EACH = "each its own"


def meetings_of(team: Team) -> list[fleet.Meeting]:
    """The meetings that there were, by the truth of frames as far apart as keyframes are."""
    seen = {
        name: [
            SeenPlace(frame.stamp_ns, frame.view, T)
            for frame in keyframes_of(robot.frames)
            if (T := robot.truth.at(frame.stamp_ns)) is not None
        ]
        for name, robot in team.items()
    }
    return fleet.meetings(seen)


def map_error_cm(team: Team, closures: Sequence[LoopClosure]) -> float | None:
    """The error of all robots in one map, aligned once; None where one is not in the map."""
    graph = PoseGraph()
    for frame in in_order(team):
        if frame.T_odom_camera is not None:
            graph.add_odometry(Odometry(T_odom_body=frame.T_odom_camera, stamp_ns=frame.stamp_ns), frame.robot)
    for closure in closures:
        graph.add_closure(closure)
    graph.optimise()
    estimated, true = list[Array](), list[Array]()
    for name, robot in team.items():
        if graph.T_map_odom_of(name) is None:
            return None
        posed = [frame.stamp_ns for frame in robot.frames if frame.T_odom_camera is not None]
        known = [(stamp, T) for stamp in posed if (T := robot.truth.at(stamp)) is not None]
        estimated += graph.corrected([stamp for stamp, _ in known], name)
        true += [T for _, T in known]
    return 100.0 * absolute_trajectory_error(estimated, true)


def with_perfect_ties(closures: Sequence[LoopClosure], truths: Truths) -> list[LoopClosure]:
    """The same closures; those between robots with true poses, and known well."""
    out = []
    for closure in closures:
        ends = truths.at(closure.from_robot, closure.from_ns), truths.at(closure.to_robot, closure.to_ns)
        if closure.from_robot != closure.to_robot and ends[0] is not None and ends[1] is not None:
            true = perfect(closure.from_ns, closure.to_ns, inverse(ends[0]) @ ends[1])
            closure = replace(closure, T_from_to=true.T_from_to, covariance=true.covariance)
        out.append(closure)
    return out


def measured(team: Team, found: Sequence[fleet.Meeting], way: Way) -> dict[str, Any]:
    """One way's figures."""
    closures, said = way(team)
    truths = Truths({name: robot.truth for name, robot in team.items()})
    errors = truths.errors(closures)
    own = {n: [c for c in closures if c.robots == (n, n)] for n in team}
    alone = {name: map_error_cm({name: team[name]}, own[name]) for name in team}
    return {
        **said,
        "constraints": len(closures),
        "false": sum(not within(error, FALSE) for error in errors),
        "between": fleet.judged(found, closures, truths),
        "pairs": {" ".join(pair): n for pair, n in sorted(Counter(c.robots for c in closures).items())},
        "map_cm": map_error_cm(team, closures),
        "perfect_ties_cm": map_error_cm(team, with_perfect_ties(closures, truths)),
        "alone_cm": alone,
        "moments": [[*closure.robots, closure.from_ns, closure.to_ns] for closure in closures],
    }


def line(name: str, row: Mapping[str, Any]) -> str:
    """A way in one line."""
    between = row["between"]
    shares = ", ".join(f"{what} {between[what]['closed']}/{between[what]['of']}" for what in ("stretches", "keyframes"))
    alone = ", ".join("-" if cm is None else f"{cm:.1f}" for cm in row["alone_cm"].values())
    own = ""
    if "kB_per_s" in row:
        own = "; kB/s " + ", ".join(f"{rate:.1f}" for rate in row["kB_per_s"].values())
    if "in_common" in row:
        own += "; in common with one registrar {common}/{of}".format(**row["in_common"])
    maps = ["-" if row[key] is None else f"{row[key]:.1f}" for key in ("map_cm", "perfect_ties_cm")]
    return (
        f"{name:14} {row['constraints']:4} constraints, {row['false']} false; between robots {between['constraints']} "
        f"({between['false']} false), {shares}; map {maps[0]} cm, perfect ties {maps[1]} cm, alone {alone} cm{own}"
    )


def chosen(ways: str, kilobytes: str) -> dict[str, Way]:
    """The ways by name; ``each its own`` once for each number of kilobytes."""
    runs: dict[str, Way] = {}
    for way in ways.split(","):
        if way != EACH:
            runs[way] = WAYS[way]
            continue
        for each in kilobytes.split(","):
            runs[f"{way}, {each} kB/s" if float(each) else way] = partial(each_its_own, kilobytes=float(each))
    return runs


def simulated(seed: int, frames: int, folder: Path) -> Path:
    """The recordings of one seed, made where they are not there yet."""
    path = folder / f"robots_{seed}_{frames}"
    if not path.exists():
        simulate_fleet(path, "robots", seed, frames, jpeg=True)
    return path


@click.command()
@click.argument("folders", nargs=-1, type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option("--simulate", "seeds", default="", metavar="SEED,SEED…", help="Simulate these and use them.")
@click.option("--frames", default=500, show_default=True, help="Frames of each simulated robot.")
@click.option("--ways", default=",".join((*WAYS, EACH)), show_default=True)
@click.option("--kilobytes", default="0,20", show_default=True, help="A second, of each robot its own; 0: no limit.")
@click.option("--model", default="", help="ONNX model; `truth`: a simulation's boxes.")
@click.option("--json", "json_file", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
@click.option("--keep", type=click.Path(file_okay=False, path_type=Path), default=Path("out/robots"), show_default=True)
def main(
    folders: tuple[Path, ...],
    seeds: str,
    frames: int,
    ways: str,
    kilobytes: str,
    model: str,
    json_file: Path | None,
    keep: Path,
) -> None:
    """Tie the robots of FOLDERS, and say how well."""
    paths = [*folders, *(simulated(int(seed), frames, keep) for seed in seeds.split(",") if seed)]
    figures: dict[str, Any] = {}
    for path in paths:
        team = team_of(path, keep, model)
        found = meetings_of(team)
        rows = figures[path.name] = {}
        for way, run in chosen(ways, kilobytes).items():
            rows[way] = measured(team, found, run)
            if "one registrar" in rows:
                rows[way]["in_common"] = in_common(rows["one registrar"]["moments"], rows[way]["moments"])
            click.echo(line(f"{path.name} {way}", rows[way]))
        if json_file is not None:
            json_file.write_text(json.dumps(figures, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
