# SPDX-License-Identifier: Apache-2.0
"""What comes of keyframes that a robot sends over Wi-Fi: two hosts, a bad link between them, and real nodes on both.

One node sends a message of 80 kB every second, reliable and transient local, the other one receives it. For each
profile of Fast DDS and each trouble of the link: how many were sent, came, came twice, how old they were when they
came, and what both ends sent. It needs root; benchmarks/hosts.py has the hosts.

    python benchmarks/wireless.py --json OUT
    python benchmarks/wireless.py --trouble 0.2:30 --profiles config/fastdds_wifi.xml --peers    without multicast, too

A test sends three messages so, on a machine that does little else:

    OBJREG_WIRELESS=1 python -m pytest test/benchmarks/test_wireless.py
"""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import click
import numpy as np
from hosts import Hosts, conditions_of, lack

from objreg_ros.bridge.process.profile import MODE, TRANSPORTS, VARIABLES, apply

REPOSITORY = Path(__file__).resolve().parents[1]
ENDS = str(Path(__file__).with_name("wireless_ends.py"))
RMWS = ("rmw_fastrtps_cpp", "rmw_cyclonedds_cpp", "rmw_zenoh_cpp")
OWN = "none"  # in place of a profile: Fast DDS as it comes
PROFILES = (OWN, "config/fastdds.xml", "config/fastdds_wifi.xml")
TROUBLES = ("0:0", "0.05:0", "0.2:0", "0:30", "0.2:30")  # loss:pause
PAUSE_AT_S = 10.0  # after the two ends met
MEETING_S = 40.0  # in which they have to meet


@dataclass(frozen=True)
class Case:
    """One run: the middleware, its profile, the link, and how much is sent."""

    rmw: str
    profile: str
    loss: float
    pause_s: float
    delay_ms: float
    mbit: float
    messages: int
    size: int
    peers: bool
    linger_s: float
    seed: int


@dataclass(frozen=True)
class Result:
    """Counts of messages; ages of those that came, in seconds, at their first coming; kB a second of either end.

    The longest frame is in bytes, and None where netem carried them.
    """

    met_s: float | None
    got: int = 0
    twice: int = 0
    age_p50_s: float | None = None
    age_p95_s: float | None = None
    sender_kb_s: float = 0.0
    receiver_kb_s: float = 0.0
    longest_frame: int | None = None


def installed(rmw: str) -> bool:
    """Whether an RMW is here, as a wheel or below a prefix of ament."""
    prefixes = [Path(prefix) for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix]
    return importlib.util.find_spec(rmw) is not None or any((path / "share" / rmw).is_dir() for path in prefixes)


def environment_of(case: Case, peer: str) -> dict[str, str]:
    """The variables of a node; the hosts are alone with each other, so it may look for others in the subnet."""
    others = {name: value for name, value in os.environ.items() if name not in (*VARIABLES, TRANSPORTS, MODE)}
    if case.profile != OWN:
        others |= dict.fromkeys(VARIABLES, str((REPOSITORY / case.profile).resolve()))
        apply(others)
    return {
        **others,
        "RMW_IMPLEMENTATION": case.rmw,
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST" if case.peers else "SUBNET",
        "ROS_STATIC_PEERS": peer if case.peers else "",
    }


def summary(lines: Sequence[str], met_s: float, seconds: float, sent_bytes: tuple[int, int]) -> Result:
    """What the receiver's lines, each a number and an age, come to."""
    numbers = Counter(line.split()[0] for line in lines)
    first = {line.split()[0]: float(line.split()[1]) for line in reversed(lines)}
    p50, p95 = np.percentile(list(first.values()), [50, 95]).tolist() if first else (None, None)
    sender_kb_s, receiver_kb_s = (sent / seconds / 1e3 for sent in sent_bytes)
    twice = sum(count > 1 for count in numbers.values())
    return Result(met_s, len(numbers), twice, p50, p95, sender_kb_s, receiver_kb_s)


def run(case: Case) -> Result:
    conditions = conditions_of(case.loss, case.delay_ms, case.mbit, case.seed)
    with Hosts(2, conditions) as hosts, tempfile.TemporaryDirectory() as folder:
        received, said = Path(folder, "received"), Path(folder, "said")
        start = time.monotonic()
        hosts.start(1, [sys.executable, ENDS, "receive", str(received)], environment_of(case, hosts.address(0)))
        command = [
            sys.executable,
            ENDS,
            "send",
            str(case.messages),
            "--size",
            str(case.size),
            "--linger",
            f"{case.linger_s}",
        ]
        sender = hosts.start(0, [*command, "--met", str(said)], environment_of(case, hosts.address(1)))
        while not said.exists():
            if time.monotonic() - start > MEETING_S or sender.poll() is not None:
                return Result(None)
            time.sleep(0.1)
        met = time.monotonic()
        carry(hosts, sender, case.pause_s)
        seconds = time.monotonic() - met - case.linger_s
        result = summary(
            received.read_text().splitlines(), met - start, seconds, (hosts.bytes_sent(0), hosts.bytes_sent(1))
        )
        longest = max(link.longest_bytes for link in hosts.relay.links) if hosts.relay else None
        return replace(result, longest_frame=longest)


def carry(hosts: Hosts, sender: subprocess.Popen[bytes], pause_s: float) -> None:
    """Until the sender has ended, with a pause where one is wanted."""
    if pause_s:
        time.sleep(PAUSE_AT_S)
        hosts.pause(pause_s)
    sender.wait()


def row(case: Case, result: Result) -> str:
    link = f"{case.loss:.0%}" + (f", pause of {case.pause_s:g} s" if case.pause_s else "")
    link += ", static peers" if case.peers else ""
    name = f"{case.rmw}, {Path(case.profile).name}"
    if result.met_s is None:
        return f"| {name} | {link} | never met | | | |"
    ages = " / ".join("–" if age is None else f"{age:.2f}" for age in (result.age_p50_s, result.age_p95_s))
    counts = f"{result.got} of {case.messages} | {result.twice}"
    return f"| {name} | {link} | {counts} | {ages} | {result.sender_kb_s:.0f} + {result.receiver_kb_s:.0f} |"


def cases(
    rmws: Sequence[str], profiles: Sequence[str], troubles: Sequence[str], peers: bool, **rest: object
) -> Iterator[Case]:
    """Every profile with every trouble; with ``peers`` the last profile once more, without multicast."""
    for rmw in rmws:
        here = profiles if "fastrtps" in rmw else [OWN]
        for profile, is_static in [*((profile, False) for profile in here), *([(here[-1], True)] if peers else [])]:
            for trouble in troubles:
                loss, _, pause_s = trouble.partition(":")
                link = (float(loss), float(pause_s or 0))
                yield Case(rmw, profile, *link, peers=is_static, **rest)  # type: ignore[arg-type]


@click.command(help=__doc__)
@click.option(
    "--rmw", "rmws", default=",".join(RMWS), show_default=True, help="those that are not installed are skipped"
)
@click.option("--profiles", default=",".join(PROFILES), show_default=True, help="of Fast DDS; none: as it comes")
@click.option(
    "--trouble", "troubles", multiple=True, default=TROUBLES, show_default=True, help="LOSS:PAUSE of the link"
)
@click.option("--delay-ms", default=20.0, show_default=True)
@click.option("--mbit", default=6.0, show_default=True, help="rate of either end's link in Mbit/s")
@click.option("--messages", default=60, show_default=True, help="sent in a run, one a second")
@click.option("--size", default=80_000, show_default=True, help="bytes of a message")
@click.option("--peers", is_flag=True, help="the last profile by known addresses without multicast, too")
@click.option("--linger", "linger_s", default=20.0, show_default=True, help="seconds in which what is late may come")
@click.option("--seed", default=0, show_default=True, help="of the losses")
@click.option("--jobs", default=4, show_default=True, help="runs at a time; each has hosts and a link of its own")
@click.option("--json", "path", type=click.Path(path_type=Path), help="where all figures go")
def main(
    rmws: str, profiles: str, troubles: tuple[str, ...], jobs: int, peers: bool, path: Path | None, **rest: object
) -> None:
    if (missing := lack()) is not None:
        raise click.ClickException(missing)
    here = [rmw for rmw in rmws.split(",") if installed(rmw)]
    for rmw in rmws.split(","):
        if rmw not in here:
            click.echo(f"{rmw} is skipped: it is not installed", err=True)
    todo = list(cases(here, profiles.split(","), troubles, peers, **rest))
    click.echo(
        "| middleware, profile | lost | came | twice | age p50 / p95, s | sent, kB/s |\n|---|---|---|---|---|---|"
    )
    done = []
    with ThreadPoolExecutor(jobs) as pool:
        for case, result in zip(todo, pool.map(run, todo), strict=True):
            click.echo(row(case, result))
            done.append({**asdict(case), **asdict(result)})
    if path is not None:
        path.write_text(json.dumps(done, indent=1) + "\n")


if __name__ == "__main__":
    main()
