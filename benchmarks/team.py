# SPDX-License-Identifier: Apache-2.0
"""Three robots live: a keyframer for each, one registrar for all, in processes of their own, on one host or on several.

    python benchmarks/team.py FOLDER --json team.json
    python benchmarks/team.py --simulate 1 --frames 60 --json team.json
    python benchmarks/team.py FOLDER --trouble 0:0 --trouble 0.2:0 --trouble 0:30 --json wifi.json    needs root

FOLDER holds a recording for each robot, as `objreg simulate --scenario robots` writes them; ``--simulate`` makes one
with this seed. What its segmenter makes of it is published at ``--rate`` frames a second; the robots start as far apart
as they were recorded. All run on this host without ``--trouble``. With LOSS:PAUSE each robot is a host of its own
(benchmarks/hosts.py), and so is the registrar; ``config/fastdds_wifi.xml`` carries what passes between them, and the
link of the second robot pauses for so many seconds.

The store keeps fewer keyframes than were searched for, where others show the same objects from beside (``max_views``).
A search is cut short while more keyframes of a robot wait than may. ``common`` counts the constraints that the first
run has too: the same two moments within a second.
"""

from __future__ import annotations

import json
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import click
import wireless
from hosts import Hosts, conditions_of, lack
from latency import TICKS
from robots import Robot, Team, simulated, team_of
from sources import SIMULATED
from team_ends import GO, READY, REPORT, SAVE, SAVED, SPENT
from team_figures import figures_of, in_common, table_of

from objreg_ros.bridge.messages import to_msg
from objreg_ros.data.frames import Frame, Odometry
from objreg_tools.cli.live import private_environment

ENDS = str(Path(__file__).with_name("team_ends.py"))
START_S, SETTLE_S, LAST_S, END_S = 600.0, 120.0, 5.0, 20.0  # a first start compiles kernels
PAUSED = 1  # the robot whose link pauses
SIMULATED_FRAMES = 500  # of each robot, where nothing else is asked for
WIFI, LOCAL = "config/fastdds_wifi.xml", "config/fastdds.xml"


@dataclass(frozen=True)
class Trouble:
    """The link of every host; without ``hosts`` there is one host and no link."""

    hosts: bool
    loss: float = 0.0
    pause_s: float = 0.0
    pause_at_s: float = 25.0
    delay_ms: float = 20.0
    mbit: float = 6.0

    @property
    def name(self) -> str:
        """As tables have it."""
        pause = f", pause of {self.pause_s:g} s" if self.pause_s else ""
        return f"hosts, {self.loss:.0%} lost{pause}" if self.hosts else "one host"


class Here:
    """One host, this one: starts processes as `Hosts` do. They end with the context."""

    def __init__(self) -> None:
        self._started: list[subprocess.Popen[bytes]] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._started:
            process.kill()
            process.wait()

    def start(self, _: int, command: Sequence[str], environment: Mapping[str, str]) -> subprocess.Popen[bytes]:
        mortal = ["setpriv", "--pdeathsig", "KILL", *command]  # nor do they outlive a script that is killed
        self._started.append(subprocess.Popen(mortal, env=environment))
        return self._started[-1]


class Field:
    """The processes of one run, by name."""

    def __init__(self, places: Here | Hosts, trouble: Trouble, robots: Sequence[str], folder: Path) -> None:
        self._places, self._trouble, self.robots, self.folder = places, trouble, robots, folder
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self._domain = private_environment()["ROS_DOMAIN_ID"]

    def start(self, name: str, host: int, profile: str, *arguments: str) -> None:
        """Run Python with these arguments on a host; its output goes to a file of its name."""
        log = self.folder / f"{name.replace('/', '_')}.log"
        command = ["sh", "-c", 'exec "$0" "$@" > "$LOG" 2>&1', sys.executable, *arguments]
        self.processes[name] = self._places.start(host, command, {**self._environment(profile), "LOG": str(log)})

    def _environment(self, profile: str) -> dict[str, str]:
        if not self._trouble.hosts:
            return {**private_environment(), "ROS_DOMAIN_ID": self._domain}
        fields = {"rmw": "rmw_fastrtps_cpp", "profile": profile, "peers": False}
        return wireless.environment_of(wireless.Case(**_bare(fields)), "")

    def node(self, name: str, host: int, module: str, *ros_args: str) -> None:
        arguments = [part for pair in ros_args for part in pair.split(" ", 1)]
        self.start(name, host, WIFI, "-m", f"objreg_ros.{module}.node", "--ros-args", *arguments)

    def require_alive(self) -> None:
        """ClickException with the last lines of a process that failed."""
        for name, process in self.processes.items():
            if process.poll():
                lines = (self.folder / f"{name.replace('/', '_')}.log").read_text().strip().splitlines()[-3:]
                raise click.ClickException(f"{name} ended with status {process.returncode}: {' / '.join(lines)}")

    def wait(self, seconds: float, what: str, there: Any) -> bool:
        """Whether it came true in time."""
        deadline = time.monotonic() + seconds
        while not there():
            self.require_alive()
            if time.monotonic() > deadline:
                click.echo(f"waited {seconds:g} s in vain for {what}", err=True)
                return False
            time.sleep(0.2)
        return True

    def end(self, *names: str) -> None:
        """End them as a user does."""
        for name in names:
            self.processes[name].send_signal(signal.SIGINT)
        for name in names:
            self.processes[name].wait(END_S)

    def report(self) -> dict[str, Any]:
        """What the witness wrote down last."""
        path = self.folder / REPORT
        return dict(json.loads(path.read_text())) if path.exists() else {"status": {}, "closures": [], "hurried": 0}


def _bare(fields: Mapping[str, Any]) -> dict[str, Any]:
    """A case of `wireless` of which only these fields matter."""
    rest = dict.fromkeys(("loss", "pause_s", "delay_ms", "mbit", "linger_s"), 0.0)
    return {**rest, "messages": 0, "size": 0, "seed": 0, **fields}


def lay_down(team: Team, rate: float, folder: Path) -> None:
    """Files for the ends: the names of labels, then of each frame when it is due and its messages."""
    from rclpy.serialization import serialize_message

    first_ns = min(robot.frames[0].stamp_ns for robot in team.values())
    for name, robot in team.items():
        stamps = [frame.stamp_ns for frame in robot.frames]
        step_ns = (stamps[-1] - stamps[0]) / max(len(stamps) - 1, 1)
        names = dict(enumerate(sorted({cloud.label for frame in robot.frames for cloud in frame.objects})))
        with Path(folder, f"{name}.frames").open("wb") as file:
            pickle.dump(serialize_message(to_msg.labels(names)), file)
            for frame in robot.frames:
                due_s = (frame.stamp_ns - first_ns) / step_ns / rate
                cdr = [(topic, serialize_message(message)) for topic, message in messages(name, frame, names)]
                pickle.dump((due_s, cdr), file)


def messages(robot: str, frame: Frame, names: dict[int, str]) -> Iterator[tuple[str, Any]]:
    """What a segmenter in the robot's namespace says of a frame, after its odometry."""
    if frame.T_odom_camera is not None:
        odometry = Odometry(T_odom_body=frame.T_odom_camera, stamp_ns=frame.stamp_ns, child_frame_id=frame.frame_id)
        yield "odom", to_msg.odometry(replace(odometry, frame_id=f"{robot}/odom"))
    yield "view", to_msg.view(frame)
    yield "view/camera_info", to_msg.view_camera_info(frame)
    yield "gravity", to_msg.gravity(frame)
    yield "objects", to_msg.objects(frame, names)


def measure(team: Team, trouble: Trouble, laid: Path) -> dict[str, Any]:
    """One run."""
    conditions = conditions_of(trouble.loss, trouble.delay_ms, trouble.mbit, seed=0)
    with ExitStack() as ends:
        folder = Path(ends.enter_context(tempfile.TemporaryDirectory()))
        for file in laid.iterdir():
            Path(folder, file.name).symlink_to(file)
        places: Here | Hosts = Hosts(len(team) + 1, conditions) if trouble.hosts else Here()
        ends.enter_context(places)
        field = Field(places, trouble, list(team), folder)
        load = [os.getloadavg()[0]]
        start_all(field)
        meter = Meter(field)
        Path(folder, GO).write_text(str(time.monotonic() + 1.0))
        if trouble.pause_s and isinstance(places, Hosts):
            time.sleep(trouble.pause_at_s)
            places.pause(trouble.pause_s, [PAUSED])
        field.wait(1e4, "all frames", lambda: all(field.processes[f"{r}/drive"].poll() == 0 for r in team))
        usage, load = meter.figures(), [*load, os.getloadavg()[0]]
        frames = {name: len(robot.frames) for name, robot in team.items()}
        settled = field.wait(SETTLE_S, "all keyframes", lambda: is_settled(field.report()["status"], frames))
        before = field.report()
        last = end_all(field)
        after = field.report()
        figures = figures_of(team, before["status"], after, field.folder / "team.db")
        return {**figures, "settled": settled, "last": last, **usage, "load": load}


def start_all(field: Field) -> None:
    """Start all nodes and ends; ClickException where they do not find each other."""
    home = len(field.robots)
    given = [f"-p {name}:={value}" for name, value in {**SIMULATED, "seed": 1}.items()]
    robots = f"-p robots:=[{','.join(field.robots)}]"
    field.node("registrar", home, "registrar", robots, f"-p store:={field.folder / 'team.db'}", *given)
    field.start("witness", home, WIFI, ENDS, "receive", str(field.folder))
    for host, robot in enumerate(field.robots):
        field.node(f"{robot}/keyframer", host, "keyframes", f"-r __ns:=/{robot}", "-p reliable:=true")
        field.start(f"{robot}/drive", host, LOCAL, ENDS, "drive", str(field.folder), robot)
    nodes = {"registrar", *(f"{robot}/keyframer" for robot in field.robots)}

    def there() -> bool:
        ready = all(Path(field.folder, f"{READY}_{robot}").exists() for robot in field.robots)
        status = field.report()["status"]
        met = [int(status.get("registrar", {}).get(f"connected: /{robot}/keyframes", 0)) for robot in field.robots]
        return ready and nodes <= status.keys() and all(met)

    if not field.wait(START_S, "all to find each other", there):
        raise click.ClickException(f"expected {', '.join(nodes)} to meet, known {', '.join(field.report()['status'])}")


def is_settled(status: Mapping[str, Mapping[str, str]], frames: Mapping[str, int]) -> bool:
    """Whether every frame came to its keyframer, and every keyframe of it to the end of its search."""
    keyframers = {robot: status[f"{robot}/keyframer"] for robot in frames}
    here = status["registrar"]
    followed = all(int(keyframers[r]["received"]) >= n and keyframers[r]["waiting"] == "0" for r, n in frames.items())
    sent = sum(int(keyframer["keyframes sent"]) for keyframer in keyframers.values())
    return followed and int(here["received"]) >= sent and here["waiting"] == "0"


def end_all(field: Field) -> int:
    """End the keyframers, save, and end the registrar; how many keyframes came of what the keyframers had left."""
    received = int(field.report()["status"]["registrar"]["received"])
    field.end(*(f"{robot}/keyframer" for robot in field.robots))
    came = lambda: int(field.report()["status"]["registrar"]["received"]) - received  # noqa: E731
    field.wait(LAST_S, "the last keyframe of each robot", lambda: came() >= len(field.robots))
    Path(field.folder, SAVE).touch()
    field.wait(END_S, "the registrar to save", Path(field.folder, SAVED).exists)
    time.sleep(2.0)  # the witness receives what that settled, and writes it down
    last = came()
    field.end("registrar")
    return last


class Meter:
    """The processor time of the processes of a field, and of all that the machine does."""

    def __init__(self, field: Field) -> None:
        self._field = field
        running = {name: process.pid for name, process in field.processes.items() if not name.endswith("/drive")}
        self._pids = running | {"this script": os.getpid()}
        self._start, self._machine = time.monotonic(), machine_seconds()
        self._begun = {name: processor_seconds(pid) for name, pid in self._pids.items()}

    def figures(self) -> dict[str, Any]:
        """Percent of one core since the start, by process; those that published frames have ended, and wrote theirs."""
        seconds = time.monotonic() - self._start
        spent = {name: processor_seconds(pid) - self._begun[name] for name, pid in self._pids.items()}
        for robot in self._field.robots:
            spent[f"{robot}/drive"] = float(Path(self._field.folder, f"{SPENT}_{robot}").read_text())
        others = machine_seconds() - self._machine - sum(spent.values())
        percent = {name: round(100 * used / seconds, 1) for name, used in spent.items()}
        return {"seconds": round(seconds, 1), "percent": percent, "others_percent": round(100 * others / seconds, 1)}


def processor_seconds(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def machine_seconds() -> float:
    """Seconds that all cores together were busy."""
    user, nice, system, _, _, irq, soft, steal = map(int, Path("/proc/stat").read_text().split()[1:9])
    return (user + nice + system + irq + soft + steal) / TICKS


def trouble_of(text: str, **rest: float) -> Trouble:
    """BadParameter for what is not LOSS:PAUSE."""
    try:
        loss, _, pause = text.partition(":")
        return Trouble(True, float(loss), float(pause or 0.0), **rest)
    except ValueError:
        raise click.BadParameter(f"expected LOSS:PAUSE, as 0.2:30, got {text!r}", param_hint="--trouble") from None


def recordings(folder: Path | None, seed: int | None, frames: int | None, keep: Path) -> Path:
    """The folder with a recording for each robot, simulated where a seed is given; UsageError for both or neither."""
    if folder is not None and seed is None:
        return folder
    if folder is None and seed is not None:
        return simulated(seed, frames or SIMULATED_FRAMES, keep)
    raise click.UsageError(f"expected FOLDER or --simulate SEED, got {'neither' if folder is None else 'both'}")


@click.command(help=__doc__)
@click.argument("folder", required=False, type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option("--simulate", "seed", type=int, metavar="SEED", help="Simulate this, in place of FOLDER.")
@click.option("--rate", default=10.0, show_default=True, help="Frames a second of each robot.")
@click.option("--frames", type=click.IntRange(min=1), help="So many of each robot, and not all; of SEED 500 by itself.")
@click.option("--trouble", "troubles", multiple=True, metavar="LOSS:PAUSE", help="Of the links of hosts; needs root.")
@click.option("--delay-ms", default=20.0, show_default=True, help="Of each link.")
@click.option("--mbit", default=6.0, show_default=True, help="Rate of each host's link in Mbit/s.")
@click.option("--pause-at", "pause_at_s", default=25.0, show_default=True, help="Seconds after the start.")
@click.option("--model", default="", help="ONNX model; `truth`: a simulation's boxes.")
@click.option("--keep", type=click.Path(file_okay=False, path_type=Path), default=Path("out/robots"), show_default=True)
@click.option("--json", "json_file", type=click.Path(dir_okay=False, path_type=Path), help="Write the figures here.")
def main(
    folder: Path | None,
    seed: int | None,
    rate: float,
    frames: int | None,
    troubles: tuple[str, ...],
    model: str,
    keep: Path,
    json_file: Path | None,
    **rest: float,
) -> None:
    cases = [trouble_of(text, **rest) for text in troubles] or [Trouble(False)]
    if troubles and (missing := lack()) is not None:
        raise click.ClickException(missing)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    whole = team_of(recordings(folder, seed, frames, keep), keep, model)
    made = {name: Robot(robot.frames[:frames], robot.truth) for name, robot in whole.items()}
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as laid:
        lay_down(made, rate, Path(laid))
        for case in cases:
            row = {"case": case.name, **measure(made, case, Path(laid))}
            if rows:
                row |= {"common": in_common(rows[0]["moments"], row["moments"]), "common_of": rows[0]["closures"]}
            rows.append(row)
            click.echo(table_of(case.name, row))
            if json_file is not None:
                json_file.write_text(json.dumps(rows, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
