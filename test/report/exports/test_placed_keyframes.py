# SPDX-License-Identifier: Apache-2.0
"""Where the keyframes of a store are on its corrected map."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from registration.samples import SECOND, keyframe, moved

from objreg_ros.data.closures import LoopClosure
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store import Store, StoreError
from objreg_tools.report.exports.placed_keyframes import PlacedKeyframes, placed_in_store
from objreg_tools.report.run.camera_map import MappedFrame

TIGHT = np.diag([1e-6] * 6)


def store_of(path: Path, *sessions: list[float], closures: tuple[LoopClosure, ...] = ()) -> Path:
    """Sessions of keyframes at these x of their own frames, 100 s apart, a keyframe a second."""
    store, number = Store(path), 0
    for session, xs in enumerate(sessions):
        for k, x in enumerate(xs):
            number += 1
            made = replace(keyframe(number, 100.0 * session + k, None, session, moved(x)), by_odometry=True)
            store.write_keyframe(made, sightings_of(made), closures if number == sum(map(len, sessions)) else ())
    store.close()
    return path


def tie(earlier: int, later: int, T_from_to: np.ndarray, k: int = 0) -> LoopClosure:
    """A closure of the keyframes number ``k`` of two sessions."""
    return LoopClosure(
        from_ns=(100 * earlier + k) * SECOND,
        to_ns=(100 * later + k) * SECOND,
        T_from_to=T_from_to,
        covariance=TIGHT,
        labels=("cup",),
        from_session=earlier,
        to_session=later,
    )


def test_two_sessions_that_a_closure_ties_are_in_the_frame_of_the_longer(tmp_path: Path) -> None:
    ties = tuple(tie(0, 1, moved(0.5, 0.2), k) for k in (0, 1))
    path = store_of(tmp_path / "a.db", [0.0, 1.0, 2.0], [0.0, 1.0], closures=ties)
    at = [(made.session, T[:3, 3]) for made, T in placed_in_store(path)]
    assert [session for session, _ in at] == [0, 0, 0, 1, 1]
    expected = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0.5, 0.2, 0), (1.5, 0.2, 0)]
    np.testing.assert_allclose([xyz for _, xyz in at], expected, atol=1e-3)


def test_a_session_that_nothing_ties_is_left_out_and_counted(tmp_path: Path) -> None:
    lines: list[str] = []
    placed = placed_in_store(store_of(tmp_path / "a.db", [0.0, 1.0, 2.0], [0.0, 1.0]), lines.append)
    assert [made.session for made, _ in placed] == [0, 0, 0]
    assert lines == ["2 keyframes of 1 sessions are tied to no others: left out"]


def test_keyframes_of_other_poses_or_of_our_own_tracking_are_not_on_the_map(tmp_path: Path) -> None:
    path = store_of(tmp_path / "a.db", [0.0, 1.0])
    frames = (MappedFrame(0, moved(0.0), moved(0.0), moved(0.1)), MappedFrame(SECOND, moved(1.1), moved(1.1), moved(1)))
    assert [T[0, 3] for _, T in PlacedKeyframes(path, frames)] == [0.1]
    assert [T is None for _, T in PlacedKeyframes(path, frames, by_odometry=True).all()] == [False, True]
    assert not list(PlacedKeyframes(path, frames, by_odometry=False))


def test_an_empty_store_has_no_keyframe_on_a_map_and_no_store_is_refused(tmp_path: Path) -> None:
    assert not list(placed_in_store(store_of(tmp_path / "a.db")))
    with pytest.raises(StoreError):
        placed_in_store(tmp_path / "none.db")
