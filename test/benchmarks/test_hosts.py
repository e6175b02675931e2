# SPDX-License-Identifier: Apache-2.0
"""Hosts of one machine: what they lack where they cannot be had, and that they receive each other where they can."""

from __future__ import annotations

import importlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import ModuleType

import pytest
from click.testing import CliRunner

BOTH = """
import os, socket, time
me = int(os.environ["HOST"])
wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
wire.bind(("0.0.0.0", 5000))
wire.settimeout(0.2)
end = time.monotonic() + 60
while time.monotonic() < end:
    wire.sendto(bytes([me]), (f"10.75.0.{2 - me}", 5000))
    try:
        if wire.recv(10) == bytes([1 - me]):
            wire.sendto(bytes([me]), (f"10.75.0.{2 - me}", 5000))
            raise SystemExit(0)
    except TimeoutError:
        pass
raise SystemExit(7)
"""


@pytest.fixture
def hosts() -> ModuleType:
    return importlib.import_module("hosts")


@pytest.fixture
def able(hosts: ModuleType) -> ModuleType:
    if (missing := hosts.lack()) is not None:
        pytest.skip(missing)
    return hosts


def wait_for(hosts: ModuleType, mine: str) -> None:
    deadline = time.monotonic() + 60
    while hosts.ip("netns", "list").count(mine) < 2:
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_without_root_it_says_so_in_one_line(hosts: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.geteuid", lambda: 1000)
    result = CliRunner().invoke(hosts.main, ["true"])
    assert result.exit_code == 1 and "expected to run as root" in result.output
    assert result.output.count("\n") <= 1


def test_without_namespaces_it_says_so(hosts: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_arguments: str) -> str:
        raise OSError("`ip netns add` says: Operation not permitted")

    for name, value in {"os.geteuid": lambda: 0, "shutil.which": str}.items():
        monkeypatch.setattr(name, value)
    monkeypatch.setattr(hosts, "netem_works", lambda: True)
    monkeypatch.setattr(hosts, "ip", refused)
    assert "expected network namespaces, got none: `ip netns add` says: Operation not permitted" in hosts.lack()


def test_the_command_for_netem_says_what_the_conditions_say(hosts: ModuleType) -> None:
    command = " ".join(hosts.netem("eth0", hosts.conditions_of(0.2, 20.0, 6.0, 1)))
    assert command == "tc qdisc replace dev eth0 root netem limit 1000 delay 20ms loss 20% rate 6000000bit"
    assert "rate" not in hosts.netem("eth0", hosts.conditions_of(0.0, 0.0, None, 1))


def test_a_number_of_hosts_that_cannot_be_is_refused(hosts: ModuleType) -> None:
    with pytest.raises(ValueError, match="expected 2 to 200 hosts, got 1"):
        hosts.Hosts(1, hosts.Conditions())


@pytest.mark.parametrize("by_netem", [False, True])
def test_two_hosts_hear_each_other_and_leave_nothing(able: ModuleType, by_netem: bool) -> None:
    """A bridge needs no netem as long as nothing is to be bad."""
    with able.Hosts(2, able.Conditions(), by_netem) as pair:
        running = [pair.start(host, [sys.executable, "-c", BOTH]) for host in range(2)]
        assert [process.wait() for process in running] == [0, 0]
        assert pair.bytes_sent(0) > 0
        sleeper = pair.start(0, ["sleep", "60"])
    assert sleeper.wait(timeout=30) == -signal.SIGTERM
    left = able.ip("netns", "list") + able.ip("link")
    assert not [name for name in pair.names if name in left]
    assert not list(Path("/dev/shm").glob(f"hosts-{os.getpid()}-*"))


def test_nothing_comes_through_a_link_that_loses_all(able: ModuleType) -> None:
    with able.Hosts(2, able.Conditions(loss=1.0), by_netem=False) as pair:
        script = BOTH.replace("+ 60", "+ 0.5")
        assert [pair.start(host, [sys.executable, "-c", script]).wait() for host in range(2)] == [7, 7]


def test_what_a_killed_run_left_is_taken_away_by_the_next(able: ModuleType, repository: Path) -> None:
    run = subprocess.Popen([sys.executable, repository / "benchmarks" / "hosts.py", "sleep", "60"])
    mine = f"hosts-{run.pid}-"
    wait_for(able, mine)
    run.kill()
    run.wait()
    able.sweep()
    assert mine not in able.ip("netns", "list") and not list(Path("/dev/shm").glob(mine + "*"))


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM])
def test_a_run_that_is_ended_takes_its_hosts_away(able: ModuleType, end: signal.Signals, repository: Path) -> None:
    run = subprocess.Popen([sys.executable, repository / "benchmarks" / "hosts.py", "sleep", "60"])
    mine = f"hosts-{run.pid}-"
    wait_for(able, mine)
    run.send_signal(end)
    assert run.wait(timeout=60) != 0 and mine not in able.ip("netns", "list")


def test_a_signal_just_after_a_host_is_made_leaves_nothing(able: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    ip = able.ip

    def ended(*arguments: str) -> str:
        said: str = ip(*arguments)
        if arguments == ("netns", "add", pair.names[1]):
            raise SystemExit(128 + signal.SIGTERM)
        return said

    pair = able.Hosts(2, able.Conditions())
    monkeypatch.setattr(able, "ip", ended)
    with pytest.raises(SystemExit), pair:
        pass
    assert not [name for name in pair.names if name in ip("netns", "list")]
    assert not list(Path("/dev/shm").glob(f"hosts-{os.getpid()}-*"))
