# SPDX-License-Identifier: Apache-2.0
"""Several hosts on this machine, joined by a link as bad as one wants: network namespaces, which need root.

Where the kernel has `tc netem`, the hosts hang on a bridge, and netem makes each one's link bad. Elsewhere, as in small
virtual machines, each host has a TAP device, and a relay in this process carries the frames between them. A host has
its own address and its own shared memory, so that no middleware finds a short way round the link.

    python benchmarks/hosts.py -n 2 --loss 0.2 --delay-ms 20 --mbit 6 -- sh -c 'ping -c 5 10.75.0.$((2 - HOST))'

runs the command in every host with HOST=0, 1, …; host k is 10.75.0.(k + 1). Nothing is left when it ends, by Ctrl-C
too, and what a killed run left is taken away by the next.
"""

from __future__ import annotations

import contextlib
import fcntl
import itertools
import json
import os
import shutil
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Self

import click
from lossy_link import Conditions, Relay

TUN, SHARED = Path("/dev/net/tun"), Path("/dev/shm")
TUNSETIFF, TAP_OF_PLAIN_FRAMES = 0x400454CA, 0x0002 | 0x1000  # <linux/if_tun.h>: IFF_TAP | IFF_NO_PI
PREFIX = "hosts"  # of all that is made; then the process that made it
SMALLEST_FRAME = 1500  # bytes: what netem, which counts packets, holds at most in its queue of bytes
NUMBERS = itertools.count()  # of the groups of hosts that this process made
PATIENCE_S = 5.0  # for processes that were asked to end


def ip(*arguments: str) -> str:
    """What the tool ``ip`` says; OSError where it says no."""
    return tool("ip", *arguments)


def tool(*command: str) -> str:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise OSError(f"`{' '.join(command)}` says: {(done.stderr or done.stdout).strip()}")
    return done.stdout


def lack() -> str | None:
    """What this machine lacks for hosts, in one line; None where it lacks nothing."""
    if os.geteuid() != 0:
        return "expected to run as root, which network namespaces need; use sudo, or a container with --privileged"
    if shutil.which("ip") is None:
        return "expected the tool `ip`, got none; install iproute2"
    if not TUN.exists() and not netem_works():
        return f"expected {TUN} or a kernel with netem, got neither; `modprobe tun` or `modprobe sch_netem`"
    name = f"{PREFIX}-{os.getpid()}-{next(NUMBERS)}"
    try:
        ip("netns", "add", name)
    except OSError as error:
        return f"expected network namespaces, got none: {error}; use a container with --privileged"
    finally:
        discard(ip, "netns", "del", name)
    return None


def netem_works() -> bool:
    """Whether this kernel has netem: tried on a device that is there for the moment only."""
    device = f"d{os.getpid()}-{next(NUMBERS)}"
    try:
        ip("link", "add", device, "type", "dummy")
    except OSError:
        return False
    try:
        tool(*netem(device, Conditions(delay_s=0.001)))
    except OSError:
        return False
    finally:
        ip("link", "del", device)
    return True


def netem(device: str, conditions: Conditions) -> list[str]:
    """The command of `tc` that makes what leaves a device as bad as these conditions."""
    command = ["tc", "qdisc", "replace", "dev", device, "root", "netem"]
    command += [
        "limit",
        str(max(1, conditions.queue_bytes // SMALLEST_FRAME)),
        "delay",
        f"{conditions.delay_s * 1e3:g}ms",
    ]
    command += ["loss", f"{conditions.loss * 100:g}%"] if conditions.loss else []
    rate = conditions.bits_per_second
    return command + (["rate", f"{rate:.0f}bit"] if rate < float("inf") else [])


class Hosts:
    """So many hosts while the context lasts. ``by_netem`` chooses the way; None takes netem where the kernel has it."""

    def __init__(self, count: int, conditions: Conditions, by_netem: bool | None = None) -> None:
        if not 2 <= count <= 200:
            raise ValueError(f"expected 2 to 200 hosts, got {count}")
        self._tag = f"{os.getpid()}-{next(NUMBERS)}"
        self.names = [f"{PREFIX}-{self._tag}-{k}" for k in range(count)]
        self.relay: Relay | None = None
        self._conditions = conditions
        self._by_netem = by_netem
        self._bridge_ports: list[str] = []
        self._ending = contextlib.ExitStack()

    def __enter__(self) -> Self:
        if (missing := lack()) is not None:
            raise OSError(missing)
        sweep()
        try:
            self._make()
        except BaseException:
            self._ending.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._ending.close()

    def address(self, host: int) -> str:
        return f"10.75.0.{host + 1}"

    def start(
        self, host: int, command: Sequence[str], environment: Mapping[str, str] | None = None
    ) -> subprocess.Popen[bytes]:
        """Start a command in a host, with HOST added to the environment; its processes end with the context."""
        memory = ["sh", "-c", 'mount --bind "$0" /dev/shm && exec "$@"', str(self._memory / str(host))]
        variables = {**(os.environ if environment is None else environment), "HOST": str(host)}
        return subprocess.Popen(["ip", "netns", "exec", self.names[host], *memory, *command], env=variables)

    def pause(self, seconds: float, hosts: Sequence[int] | None = None) -> None:
        """Nothing comes to these hosts or from them for so long, to any where None.

        Returns at once where a relay carries the frames, else after the pause.
        """
        if self.relay is not None:
            return self.relay.pause(seconds, hosts)
        ports = self._bridge_ports if hosts is None else [self._bridge_ports[host] for host in hosts]
        for port in ports:
            ip("link", "set", port, "nomaster")
        time.sleep(seconds)
        for port in ports:
            ip("link", "set", port, "master", self._bridge)

    def bytes_sent(self, host: int) -> int:
        """All that a host sent so far, with the Ethernet headers."""
        link = json.loads(ip("-n", self.names[host], "-j", "-s", "link", "show", "dev", "eth0"))[0]
        return int(link["stats64"]["tx"]["bytes"])

    def _make(self) -> None:
        self._memory = SHARED / f"{PREFIX}-{self._tag}"
        self._ending.callback(shutil.rmtree, self._memory, ignore_errors=True)
        self._memory.mkdir()
        for host, name in enumerate(self.names):
            (self._memory / str(host)).mkdir()
            self._ending.callback(discard, remove, name)
            ip("netns", "add", name)
        by_netem = netem_works() if self._by_netem is None else self._by_netem
        (self._bridge_them if by_netem else self._relay_them)()
        for host, name in enumerate(self.names):
            ip("-n", name, "link", "set", "lo", "up")
            ip("-n", name, "link", "set", "eth0", "addrgenmode", "none")  # no IPv6, which would talk unasked
            ip("-n", name, "addr", "add", f"{self.address(host)}/24", "dev", "eth0")
            ip("-n", name, "link", "set", "eth0", "up")

    def _relay_them(self) -> None:
        ports = []
        for host, name in enumerate(self.names):
            ports.append(fd := open_tap(device := f"t{self._tag}-{host}"))
            self._ending.callback(os.close, fd)
            ip("link", "set", device, "netns", name, "name", "eth0")
        self.relay = Relay(ports, self._conditions)
        self.relay.start()
        self._ending.callback(self.relay.stop)

    def _bridge_them(self) -> None:
        self._bridge = f"b{self._tag}"
        self._ending.callback(discard, ip, "link", "del", self._bridge)
        ip("link", "add", self._bridge, "type", "bridge")
        ip("link", "set", self._bridge, "up")
        for host, name in enumerate(self.names):
            self._bridge_ports.append(port := f"v{self._tag}-{host}")
            ip("link", "add", port, "type", "veth", "peer", "name", "eth0", "netns", name)
            ip("link", "set", port, "master", self._bridge, "up")
            if self._conditions != Conditions(queue_bytes=self._conditions.queue_bytes, seed=self._conditions.seed):
                tool("ip", "netns", "exec", name, *netem("eth0", self._conditions))


def open_tap(device: str) -> int:
    """A new TAP device, which is gone when its descriptor is closed."""
    fd = os.open(TUN, os.O_RDWR)
    fcntl.ioctl(fd, TUNSETIFF, struct.pack("16sH22x", device.encode(), TAP_OF_PLAIN_FRAMES))
    return fd


def remove(name: str) -> None:
    """End what runs in a namespace, and take the namespace away; a veth in it goes with it."""
    signals = [signal.SIGTERM, signal.SIGKILL]
    deadline = time.monotonic() + PATIENCE_S
    while pids := [int(pid) for pid in ip("netns", "pids", name).split()]:
        for pid in pids:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signals[0])
        if time.monotonic() > deadline:
            del signals[:-1]
        time.sleep(0.05)
    ip("netns", "del", name)


def discard(take_away: Callable[..., object], *arguments: str) -> None:
    """Take away what may be there: a signal that ends the process can come before it is made, and just after."""
    with contextlib.suppress(OSError):
        take_away(*arguments)


def sweep() -> None:
    """Take away what a process left that was killed outright."""
    for line in ip("netns", "list").splitlines():
        if is_left(name := line.split()[0]):
            discard(remove, name)  # which another run may do, too
    for folder in SHARED.glob(f"{PREFIX}-*"):
        if is_left(folder.name):
            shutil.rmtree(folder, ignore_errors=True)


def is_left(name: str) -> bool:
    """Whether a name is of something that was made here, by a process that is no more."""
    kind, _, rest = name.partition("-")
    maker = rest.partition("-")[0]
    return kind == PREFIX and maker.isdigit() and not Path("/proc", maker).exists()


def conditions_of(loss: float, delay_ms: float, mbit: float | None, seed: int) -> Conditions:
    rate = float("inf") if mbit is None else mbit * 1e6
    return Conditions(loss=loss, delay_s=delay_ms / 1e3, bits_per_second=rate, seed=seed)


def link_options(command: Callable[..., None]) -> Callable[..., None]:
    """The options that say how bad the link is."""
    for option in (
        click.option("--seed", default=0, show_default=True, help="of the losses, where a relay makes them"),
        click.option("--mbit", type=float, help="rate of each host's link in Mbit/s; without limit if not given"),
        click.option("--delay-ms", default=0.0, show_default=True, help="of every frame"),
        click.option("--loss", default=0.0, show_default=True, help="share of the frames that are lost, 0 to 1"),
    ):
        command = option(command)
    return command


@click.command(help=__doc__, context_settings={"ignore_unknown_options": True})
@click.option("-n", "count", default=2, show_default=True, help="how many hosts")
@link_options
@click.option("--pause-at", type=float, help="seconds after the start at which the link pauses")
@click.option("--pause", "pause_s", default=30.0, show_default=True, help="how long it pauses, in seconds")
@click.argument("command", nargs=-1, required=True, type=click.UNPROCESSED)
def main(
    count: int,
    loss: float,
    delay_ms: float,
    mbit: float | None,
    seed: int,
    pause_at: float | None,
    pause_s: float,
    command: tuple[str, ...],
) -> None:
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    try:
        with Hosts(count, conditions_of(loss, delay_ms, mbit, seed)) as hosts:
            running = [hosts.start(host, command) for host in range(count)]
            if pause_at is not None:
                time.sleep(pause_at)
                hosts.pause(pause_s)
            status = max(process.wait() for process in running)
            for host in range(count):
                click.echo(f"host {host}: {hosts.bytes_sent(host)} bytes sent", err=True)
    except (OSError, ValueError) as error:
        raise click.ClickException(str(error)) from None
    sys.exit(status)


if __name__ == "__main__":
    main()
