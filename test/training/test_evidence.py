# SPDX-License-Identifier: Apache-2.0
"""What is kept of poses that the gate is asked about."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from registration.samples import candidate, moved

from objreg_ros.registration.gate.kinds import KINDS
from objreg_tools.simulation.sensors.camera import SENSORS
from training import evidence
from training.evidence import RIGS, SCENARIOS, Rows, gather, plans, rows_of


def rows(count: int, sensor: str = "kinect_v1") -> Rows:
    each = np.arange(count)
    return Rows(
        np.zeros((count, len(KINDS))), np.zeros((count, 2)), each > 99, each // 2, each % 2, np.full(count, sensor)
    )


def test_every_scenario_is_seen_by_every_sensor_in_every_rig_in_a_room_of_its_own() -> None:
    listed = plans(100)
    assert len(listed) == len(SCENARIOS) * len(SENSORS) * len(RIGS)
    assert sorted(one.seed for one in listed) == list(range(100, 100 + len(listed)))
    assert len({one.name for one in listed}) == len(listed)


def test_a_row_has_the_error_whether_a_rule_refuses_and_the_readings() -> None:
    ((degrees, cm, refused, pair, rank, *readings),) = rows_of(
        (candidate(moved(0.1), correlation=None),), None, np.eye(4), 3
    )
    assert (degrees, cm) == pytest.approx((0.0, 10.0)) and not refused and (pair, rank) == (3, 0)
    assert len(readings) == len(KINDS) and np.isnan(readings[list(KINDS).index("correlation")])


def test_a_candidate_far_below_the_best_is_left_out_as_the_gate_never_comes_to_it() -> None:
    made = rows_of((candidate(), candidate(score=0.79, matched=()), candidate(score=0.2)), None, np.eye(4), 0)
    assert [bool(refused) for _, _, refused, *_ in made] == [False, True]


def test_rows_come_back_as_they_were_written_and_pairs_are_counted_on(tmp_path: Path) -> None:
    rows(4).save(tmp_path / "a.npz")
    joined = Rows.joined([Rows.load(tmp_path / "a.npz"), rows(2, "azure_kinect")])
    assert joined.pair.tolist() == [0, 0, 1, 1, 2, 2] and joined.sensor[-1] == "azure_kinect" and len(joined) == 6


def test_readings_of_other_kinds_are_refused(tmp_path: Path) -> None:
    Rows(np.zeros((1, 3)), *(np.zeros((1, 2)), *(np.zeros(1, int),) * 3), np.full(1, "a")).save(tmp_path / "a.npz")
    with pytest.raises(ValueError, match=f"expected {len(KINDS)} readings a row, got .*; gather anew"):
        Rows.load(tmp_path / "a.npz")


def test_a_recording_is_simulated_and_every_pair_that_the_gate_sees_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(evidence, "FRAMES", 16)
    monkeypatch.setattr(evidence, "RATE", 2.0)
    found = gather(plans(7)[0])
    right = (found.error < (5.0, 10.0)).all(axis=1)
    assert len(found) > 0 and right.any() and (found.rank[:1] == 0).all() and set(found.sensor) == {"kinect_v1"}
    assert np.array_equal(gather(plans(7)[0]).readings, found.readings, equal_nan=True)  # made again to the bit
