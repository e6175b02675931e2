# SPDX-License-Identifier: Apache-2.0
"""A map that was saved is the same map another day, and goes on."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from objreg_mapper import saved
from objreg_mapper.params import MapperParams
from objreg_mapper.pose_graph import PoseGraph
from objreg_ros.data.closures import LoopClosure
from objreg_ros.geometry import pose, rotation_from_vector

from .bent import SECOND, bent, closure, distances, odometry, square

TRUE = square(laps=2)
BENT = bent(TRUE)
HEADER = "told"  # the member of the file that is a text
HALF = len(TRUE) // 2
LATER_NS = 86_400 * SECOND
ELSEWHERE = pose(rotation_from_vector(np.array([0.0, 0.0, 0.7])), np.array([3.0, 1.0, 0.0]))


@pytest.fixture
def yesterday() -> PoseGraph:
    graph = PoseGraph()
    for sample in odometry(BENT):
        graph.add_odometry(sample)
    for k in range(3, HALF, 13):
        assert graph.add_closure(replace(closure(TRUE, k, k + HALF), from_session=7, to_session=7))
    graph.optimise()
    return graph


def again(k: int, later: int) -> LoopClosure:
    """Today's step ``later`` sees what yesterday's step ``k`` saw."""
    found = closure(TRUE, k, later)
    return replace(found, to_ns=found.to_ns + LATER_NS)


def test_a_map_comes_back_as_it_was(yesterday: PoseGraph, tmp_path: Path) -> None:
    saved.save(saved.packed(yesterday), tmp_path / "map.npz")
    found = saved.load(tmp_path / "map.npz", MapperParams())
    found.optimise()
    (way,), expected = found.paths(), yesterday.path()
    assert not found.is_placed and found.path() == [] and found.sessions[0].names == {7}
    assert [stamp for stamp, _ in way] == [stamp for stamp, _ in expected]
    assert distances([T for _, T in way], [T for _, T in expected]).max() < 1e-3
    assert found.sessions[0].odometry.covers(5 * SECOND) and not found.sessions[0].covers(LATER_NS)


def test_the_next_day_goes_on_in_the_map_once_two_closures_agree_on_where(yesterday: PoseGraph, tmp_path: Path) -> None:
    saved.save(saved.packed(yesterday), tmp_path / "map.npz")
    today = saved.load(tmp_path / "map.npz", MapperParams())
    late = [replace(w, stamp_ns=w.stamp_ns + LATER_NS, T_odom_body=ELSEWHERE @ w.T_odom_body) for w in odometry(BENT)]
    for sample in late:
        today.add_odometry(sample)
    placed = []
    for k in (5, 15, 35, 55):
        assert today.add_closure(again(k, k + 4))
        assert not today.optimise().pruned
        placed.append(today.is_placed)
    assert placed == [False, True, True, True]
    assert distances(today.corrected(w.stamp_ns for w in late[:HALF]), TRUE[:HALF]).max() < 0.25
    saved.save(saved.packed(today), tmp_path / "map.npz")
    assert [len(path) for path in saved.load(tmp_path / "map.npz", MapperParams()).paths()] == [
        len(today.keyframes),
        0,
    ]


def test_a_withdrawn_closure_is_not_saved(yesterday: PoseGraph, tmp_path: Path) -> None:
    first = yesterday.closure_ties[0].closure
    assert yesterday.withdraw(lambda one: one is first) == 1
    saved.save(saved.packed(yesterday), tmp_path / "map.npz")
    assert len(saved.load(tmp_path / "map.npz", MapperParams()).closure_ties) == len(yesterday.closure_ties) == 5


@pytest.mark.parametrize("spoil", [b"", b"PK\x03\x04 no archive", b"text"])
def test_what_is_no_map_is_refused(spoil: bytes, tmp_path: Path) -> None:
    (tmp_path / "map.npz").write_bytes(spoil)
    with pytest.raises(ValueError, match="expected a map that ~/save wrote"):
        saved.load(tmp_path / "map.npz", MapperParams())


def test_a_map_with_a_keyframe_that_it_has_not_is_refused(yesterday: PoseGraph, tmp_path: Path) -> None:
    saved.save(saved.packed(yesterday), tmp_path / "map.npz")
    with np.load(tmp_path / "map.npz") as file:
        arrays = {name: file[name] for name in file.files}
    arrays["ends"][0, 1] = 100_000
    np.savez(tmp_path / "map.npz", **arrays)
    with pytest.raises(ValueError, match="expected a keyframe of the graph"):
        saved.load(tmp_path / "map.npz", MapperParams())


@pytest.mark.parametrize(
    ("name", "value"),
    [("T_1_2", np.nan), ("T_1_2", 0.0), ("covariances", np.nan), ("covariances", 0.0), ("0_variances", np.inf)],
)
def test_numbers_that_no_map_has_are_refused(yesterday: PoseGraph, tmp_path: Path, name: str, value: float) -> None:
    arrays = saved.packed(yesterday)
    arrays[name] = np.full_like(arrays[name], value)
    saved.save(arrays, tmp_path / "map.npz")
    with pytest.raises(ValueError, match="expected a map that ~/save wrote"):
        saved.load(tmp_path / "map.npz", MapperParams())


def test_a_file_with_a_wrong_byte_is_refused_or_the_same_map(yesterday: PoseGraph, tmp_path: Path) -> None:
    saved.save(saved.packed(yesterday), tmp_path / "map.npz")
    whole = (tmp_path / "map.npz").read_bytes()
    rng = np.random.default_rng(0)
    for at in rng.integers(0, len(whole), 60).tolist():
        (tmp_path / "spoilt.npz").write_bytes(whole[:at] + bytes([whole[at] ^ 0x55]) + whole[at + 1 :])
        try:
            found = saved.load(tmp_path / "spoilt.npz", MapperParams())
        except ValueError:
            continue
        assert len(found.closure_ties) == len(yesterday.closure_ties)


def changed(arrays: dict[str, np.ndarray], change: Callable[[dict[str, Any]], object]) -> dict[str, np.ndarray]:
    """The arrays of a map whose text was changed."""
    header = json.loads(arrays[HEADER].tobytes())
    change(header)
    return arrays | {HEADER: np.frombuffer(json.dumps(header).encode(), np.uint8)}


@pytest.mark.parametrize("stamp", [np.inf, -np.inf, np.nan, 1e300, 2**70, -(2**70), "1", None, True])
def test_a_stamp_that_no_clock_has_is_refused(yesterday: PoseGraph, tmp_path: Path, stamp: object) -> None:
    arrays = changed(saved.packed(yesterday), lambda header: header["closures"][0].update(from_ns=stamp))
    saved.save(arrays, tmp_path / "map.npz")
    with pytest.raises(ValueError, match="expected a map that ~/save wrote"):
        saved.load(tmp_path / "map.npz", MapperParams())


def test_stamps_of_odometry_that_no_message_holds_are_refused(yesterday: PoseGraph, tmp_path: Path) -> None:
    arrays = saved.packed(yesterday)
    for name in ("0_stamps_ns", "0_keyframes"):
        arrays[name] = arrays[name] + 2**62
    saved.save(arrays, tmp_path / "map.npz")
    with pytest.raises(ValueError, match="expected stamps that ROS has"):
        saved.load(tmp_path / "map.npz", MapperParams())


def test_a_map_without_some_of_its_closures_is_refused(yesterday: PoseGraph, tmp_path: Path) -> None:
    saved.save(changed(saved.packed(yesterday), lambda header: header["closures"].pop()), tmp_path / "map.npz")
    with pytest.raises(ValueError, match=r"expected 5 closures everywhere, got .*'ends': 6"):
        saved.load(tmp_path / "map.npz", MapperParams())


def test_what_no_map_has_is_refused_before_it_is_unpacked(yesterday: PoseGraph, tmp_path: Path) -> None:
    arrays = saved.packed(yesterday)
    saved.save(arrays | {"spare": np.zeros(1000)}, tmp_path / "map.npz")
    with pytest.raises(ValueError, match="expected arrays of 1 sessions, got more or fewer: spare"):
        saved.load(tmp_path / "map.npz", MapperParams())
    saved.save(arrays | {"T_1_2": np.zeros((saved.MOST_BYTES // 128 + 1, 4, 4))}, tmp_path / "map.npz")
    with pytest.raises(ValueError, match=f"expected at most {saved.MOST_BYTES} bytes unpacked"):
        saved.load(tmp_path / "map.npz", MapperParams())
    del arrays["ends"]
    saved.save(arrays, tmp_path / "map.npz")
    with pytest.raises(ValueError, match="got more or fewer: ends"):
        saved.load(tmp_path / "map.npz", MapperParams())


@pytest.mark.parametrize("name", ["T_1_2", "covariances", "0_poses"])
def test_a_map_of_complex_numbers_is_refused(yesterday: PoseGraph, tmp_path: Path, name: str) -> None:
    arrays = saved.packed(yesterday)
    np.savez(tmp_path / "map.npz", **{**arrays, name: arrays[name] * (1 + 0j)})
    with pytest.raises(ValueError, match=f"expected real numbers, got others in {name}"):
        saved.load(tmp_path / "map.npz", MapperParams())


def test_a_map_of_before_robots_is_of_one_without_a_name(yesterday: PoseGraph, tmp_path: Path) -> None:
    arrays = saved.packed(yesterday)
    header = json.loads(arrays[HEADER].tobytes())
    del header["robots"]
    for known in header["closures"]:
        del known["from_robot"], known["to_robot"]
    arrays[HEADER] = np.frombuffer(json.dumps(header | {"version": 1}).encode(), np.uint8)
    saved.save(arrays, tmp_path / "map.npz")
    found = saved.load(tmp_path / "map.npz", MapperParams())
    assert [one.robot for one in found.sessions] == [""] and found.closure_ties[0].closure.robots == ("", "")
    arrays[HEADER] = np.frombuffer(json.dumps(header | {"version": 3}).encode(), np.uint8)
    saved.save(arrays, tmp_path / "map.npz")
    with pytest.raises(ValueError, match="version: expected 1 or 2, got 3"):
        saved.load(tmp_path / "map.npz", MapperParams())
