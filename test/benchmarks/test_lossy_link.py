# SPDX-License-Identifier: Apache-2.0
"""What a bad link does to frames, and how the relay carries them."""

from __future__ import annotations

import importlib
import math
import socket
import time
from collections.abc import Iterator
from types import ModuleType

import pytest

A, B, C, ALL = (bytes([0, 0, 0, 0, 0, k]) for k in (1, 2, 3, 255))


@pytest.fixture
def lossy_link() -> ModuleType:
    return importlib.import_module("lossy_link")


def test_a_perfect_link_carries_a_frame_at_once(lossy_link: ModuleType) -> None:
    assert lossy_link.Link(lossy_link.Conditions()).arrival_s(5.0, 1500) == 5.0


def test_a_frame_waits_for_those_before_it_takes_its_time_and_comes_late(lossy_link: ModuleType) -> None:
    link = lossy_link.Link(lossy_link.Conditions(delay_s=0.02, bits_per_second=8000.0))
    arrivals = [link.arrival_s(now_s, 100) for now_s in (0.0, 0.0, 0.05, 1.0)]
    assert arrivals == pytest.approx([0.12, 0.22, 0.32, 1.12])


def test_a_queue_that_is_full_loses_what_comes(lossy_link: ModuleType) -> None:
    link = lossy_link.Link(lossy_link.Conditions(bits_per_second=8000.0, queue_bytes=250))
    assert [link.arrival_s(0.0, 100) is None for _ in range(4)] == [False, False, True, True]
    assert link.arrival_s(0.06, 100) is not None, "there is room again when a frame has been sent"
    assert link.counts == {"carried": 3, "overflowed": 2}


@pytest.mark.parametrize("loss", [0.0, 0.05, 0.2, 1.0])
def test_as_many_are_lost_as_the_link_is_set_to_lose(lossy_link: ModuleType, loss: float) -> None:
    link = lossy_link.Link(lossy_link.Conditions(loss=loss, seed=3))
    lost = sum(link.arrival_s(float(k), 1) is None for k in range(10_000)) / 10_000
    assert abs(lost - loss) <= 4 * math.sqrt(loss * (1 - loss) / 10_000)


def test_the_seed_and_the_lane_decide_which_are_lost(lossy_link: ModuleType) -> None:
    def lost(seed: int, lane: int) -> list[bool]:
        link = lossy_link.Link(lossy_link.Conditions(loss=0.5, seed=seed), lane)
        return [link.arrival_s(float(k), 1) is None for k in range(64)]

    assert lost(1, 0) == lost(1, 0) and lost(1, 0) != lost(1, 1) and lost(1, 0) != lost(2, 0)


def test_a_pause_loses_all_that_is_sent_in_it_and_nothing_after(lossy_link: ModuleType) -> None:
    link = lossy_link.Link(lossy_link.Conditions())
    link.pause(until_s=30.0)
    assert [link.arrival_s(now_s, 1) for now_s in (10.0, 29.9, 30.0)] == [None, None, 30.0]
    assert link.counts["paused"] == 2


@pytest.mark.parametrize("wrong", [{"loss": 1.1}, {"delay_s": -1.0}, {"bits_per_second": 0.0}, {"queue_bytes": 0}])
def test_conditions_that_no_link_has_are_refused(lossy_link: ModuleType, wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"expected a (loss|delay) of"):
        lossy_link.Conditions(**wrong)


def test_a_switch_floods_until_it_knows_where_an_address_is(lossy_link: ModuleType) -> None:
    switch = lossy_link.Switch(3)
    assert switch.targets(0, B + A) == [1, 2]
    assert switch.targets(1, A + B) == [0]
    assert switch.targets(2, B + C) == [1]
    assert switch.targets(1, ALL + B) == [0, 2]
    assert switch.targets(0, A + A) == [], "who is asked is on the same side"


@pytest.fixture
def wires() -> Iterator[list[tuple[socket.socket, socket.socket]]]:
    """Pairs of ends that keep frames apart, as TAP devices do: the host's and the relay's."""
    pairs = [socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET) for _ in range(3)]
    yield pairs
    for end in (end for pair in pairs for end in pair):
        end.close()


def test_the_relay_carries_frames_whole_and_late_and_not_in_a_pause(
    lossy_link: ModuleType, wires: list[tuple[socket.socket, socket.socket]]
) -> None:
    relay = lossy_link.Relay([inner.fileno() for _, inner in wires], lossy_link.Conditions(delay_s=0.03))
    relay.start()
    (first, _), (second, _), (third, _) = wires
    for end in (first, second, third):
        end.settimeout(5.0)
    start = time.monotonic()
    first.send(ALL + A + b"to all")
    assert second.recv(100) == third.recv(100) == ALL + A + b"to all"
    assert time.monotonic() - start >= 0.03
    relay.pause(0.2)
    first.send(ALL + A + b"lost")
    time.sleep(0.25)
    second.send(A + B + b"back")
    assert first.recv(100) == A + B + b"back"
    relay.stop()
    third.settimeout(0.01)
    with pytest.raises(TimeoutError):
        third.recv(100)
    assert relay.links[0].counts == {"carried": 1, "paused": 1}


def test_a_pause_of_one_port_cuts_that_one_off_both_ways_and_leaves_the_others(
    lossy_link: ModuleType, wires: list[tuple[socket.socket, socket.socket]]
) -> None:
    relay = lossy_link.Relay([inner.fileno() for _, inner in wires], lossy_link.Conditions())
    relay.start()
    (first, _), (second, _), (third, _) = wires
    relay.pause(60.0, [0])
    first.send(ALL + A + b"lost")
    second.send(ALL + B + b"to the third")
    for end, expected in ((third, [ALL + B + b"to the third"]), (second, []), (first, [])):
        end.settimeout(5.0 if expected else 0.05)
        assert [end.recv(100) for _ in expected] == expected
        end.settimeout(0.05)
        with pytest.raises(TimeoutError):
            end.recv(100)
    relay.stop()
