# SPDX-License-Identifier: Apache-2.0
"""The scan for the nearest objects: its answers are those of looking at every object, one by one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import Generator

from objreg_ros.memory.descriptor import EMPHASIS, SIZE
from objreg_ros.memory.nearest_neighbours import LANES, Block, SessionFilter
from objreg_ros.memory.sighting import Sighting
from objreg_ros.registrar.params import RegistrarParams

PARAMS = RegistrarParams(min_gap=2.0, odometry_radius=1.0, odometry_drift=0.1)
MOST, MARGIN = 8, 8.0
OWN = SessionFilter.of((0, 1), ())


def _sighting(number: int, draw: Generator, spread: float = 1.0) -> Sighting:
    return Sighting(
        keyframe_id=number,
        session=int(draw.integers(2)),
        stamp_ns=int(draw.integers(20)) * 10**9,
        instance=1,
        label="cup",
        score=1.0,
        extent=0.1,
        descriptor=(spread * draw.normal(size=SIZE)).astype(np.float32),
        position=draw.uniform(-2, 2, 3),
        camera=np.zeros(3),
        travelled=float(draw.uniform(0, 20)),
        by_odometry=bool(draw.random() < 0.7),
    )


def _brute_force(stored: list[Sighting], row: Sighting) -> list[int]:
    """The keyframes of the nearest, by the book."""
    halves = {}
    for other in stored:
        if abs(other.stamp_ns - row.stamp_ns) < 1e9 * PARAMS.min_gap:
            continue
        reach = PARAMS.odometry_radius + PARAMS.odometry_drift * abs(row.travelled - other.travelled)
        bound = other.session == row.session and other.by_odometry and row.by_odometry
        if bound and np.linalg.norm(other.position - row.position) > reach:
            continue
        halves[other.keyframe_id] = 0.5 * float(
            np.sum((EMPHASIS * (other.descriptor.astype(float) - row.descriptor)) ** 2)
        )
    ranked = sorted(halves, key=lambda number: (halves[number], number))[:MOST]
    return [number for number in ranked if halves[number] < halves[ranked[0]] + MARGIN]


@pytest.mark.parametrize("seed", range(25))
def test_a_scan_finds_what_brute_force_finds(seed: int) -> None:
    draw = np.random.default_rng(seed)
    block, stored = Block(), []
    for number in range(int(draw.integers(1, 6 * LANES))):
        stored.append(_sighting(number, draw, 0.1 + 0.1 * (seed % 5)))
        block.append(stored[-1])
    for row in (_sighting(9999, draw) for _ in range(10)):
        rows, halves = block.nearest(row, PARAMS, MOST, MARGIN, OWN)
        assert block.when[rows, 2].tolist() == _brute_force(stored, row)
        exact = [0.5 * np.sum((EMPHASIS * (stored[k].descriptor - row.descriptor)) ** 2) for k in block.when[rows, 2]]
        assert np.allclose(halves, exact, atol=1e-4)


@pytest.mark.parametrize("spread", [0.01, 0.3, 1.0, 10.0])  # the last is far beyond what bytes can say
def test_a_scan_of_many_tiles_leaves_out_none_of_the_nearest(spread: float) -> None:
    draw = np.random.default_rng(7)
    block, stored = Block(), [_sighting(number, draw, spread) for number in range(4 * MOST * LANES)]
    for sighting in stored:
        block.append(sighting)
    for row in (*(_sighting(9999, draw, spread) for _ in range(5)), replace(stored[70], stamp_ns=10**12)):
        rows, _ = block.nearest(row, PARAMS, MOST, MARGIN, OWN)
        assert block.when[rows, 2].tolist() == _brute_force(stored, row)


@pytest.mark.parametrize("seed", range(5))
def test_rows_that_were_given_up_are_not_found_and_are_used_again(seed: int) -> None:
    draw = np.random.default_rng(seed)
    block = Block()
    held: dict[int, tuple[Sighting, int]] = {}
    for number in range(800):
        if held and draw.random() < 0.45:
            block.remove(held.pop(list(held)[int(draw.integers(len(held)))])[1])
        sighting = _sighting(number, draw)
        held[number] = sighting, block.append(sighting)
    assert len(block) == len(held) and len(block.when) < 800
    row = _sighting(9999, draw)
    rows, _ = block.nearest(row, PARAMS, MOST, MARGIN, OWN)
    assert block.when[rows, 2].tolist() == _brute_force([sighting for sighting, _ in held.values()], row)


def test_what_another_robot_saw_at_the_same_time_may_be_here_and_hidden_sessions_may_not() -> None:
    draw = np.random.default_rng(0)
    pattern, block = replace(_sighting(0, draw), by_odometry=False), Block()
    for number, session in ((1, 3), (2, 5), (3, 7)):
        block.append(replace(pattern, keyframe_id=number, session=session))
    asked = replace(pattern, keyframe_id=9, session=3)
    found = {
        hidden: block.when[block.nearest(asked, PARAMS, MOST, MARGIN, SessionFilter.of((3, 5), hidden))[0], 2].tolist()
        for hidden in ((), (7,))
    }
    assert found == {(): [3], (7,): []}


def test_among_equals_the_older_keyframe_comes_first() -> None:
    draw = np.random.default_rng(0)
    pattern = _sighting(0, draw)
    block = Block()
    for number in (5, 3, 4, 1, 2):
        block.append(replace(pattern, keyframe_id=number))
    late = replace(pattern, stamp_ns=10**12)
    rows, halves = block.nearest(late, PARAMS, 3, MARGIN)
    assert block.when[rows, 2].tolist() == [1, 2, 3] and np.allclose(halves, 0, atol=1e-5)


def test_a_block_of_nothing_that_may_be_here_answers_nothing() -> None:
    draw = np.random.default_rng(0)
    block, row = Block(), _sighting(1, draw)
    block.append(row)
    assert [len(column) for column in block.nearest(row, PARAMS, MOST, MARGIN, OWN)] == [0, 0]
