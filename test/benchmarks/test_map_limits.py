# SPDX-License-Identifier: Apache-2.0
"""Tests of what is made of closures to find what limits a trajectory."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import click
import numpy as np
import pytest

from objreg_ros.data.closures import LoopClosure
from objreg_ros.geometry import pose
from objreg_tools.truth import Truth

SECOND = 10**9


@pytest.fixture(autouse=True)
def _gtsam() -> None:
    pytest.importorskip("gtsam", reason="the map is solved with gtsam")


@pytest.fixture
def case() -> Any:
    """A walk of 10 m along x and back, at 1 m/s; closures err 10 cm, two of them between the same two places."""
    xs = [*range(11), *range(9, -1, -1)]
    true = [pose(np.eye(3), np.array([float(x), 0.0, 0.0])) for x in xs]
    frames = [SimpleNamespace(stamp_ns=k * SECOND, T_odom_camera=T) for k, T in enumerate(true)]
    truth = Truth((k * SECOND, T) for k, T in enumerate(true))
    closures = []
    for a, b in ((0, 20), (1, 19), (5, 15)):
        T = truth.between(a * SECOND, b * SECOND)
        assert T is not None
        wrong = T @ pose(np.eye(3), np.array([0.1, 0.0, 0.0]))
        closures.append(
            LoopClosure(from_ns=a * SECOND, to_ns=b * SECOND, T_from_to=wrong, covariance=0.01 * np.eye(6), labels=())
        )
    return SimpleNamespace(frames=frames, truth=truth, closures=closures)


def test_perfect_closures_are_of_the_same_pairs_with_the_same_covariances(case: Any) -> None:
    import map_limits

    for closure, other in zip(map_limits.perfect(case, case.frames), case.closures, strict=True):
        assert (closure.from_ns, closure.to_ns) == (other.from_ns, other.to_ns)
        assert np.allclose(closure.T_from_to, case.truth.between(closure.from_ns, closure.to_ns))
        assert np.array_equal(closure.covariance, other.covariance)


def test_closures_between_the_same_stretches_share_what_one_knows(case: Any) -> None:
    import map_limits

    near = [closure.covariance[0, 0] for closure in map_limits.thinned(3.0)(case, case.frames)]
    alone = [closure.covariance[0, 0] for closure in map_limits.thinned(0.5)(case, case.frames)]
    assert near == pytest.approx([0.02, 0.02, 0.01]) and alone == pytest.approx([0.01] * 3)


def test_errors_and_claims_are_reported(case: Any) -> None:
    import map_limits

    figures = map_limits.consistency(case)
    assert figures["error_cm"] == pytest.approx(10.0) and figures["claimed_cm"] == pytest.approx(10.0 * np.sqrt(3))
    assert figures["squared_in_variances"] == pytest.approx(1 / 6)


def test_perfect_closures_of_a_walk_leave_nothing_of_its_error(case: Any) -> None:
    import map_limits

    for name in (map_limits.OURS, map_limits.PERFECT):
        before, after, pruned = map_limits.trajectory_errors(case, case.frames, map_limits.variants()[name])
        assert before < 1e-6 and pruned == 0 and (after < 1e-3) == (name == map_limits.PERFECT)


@pytest.mark.parametrize("mode", [0o777, 0o720, 0o702])
def test_a_folder_that_others_write_gives_no_pickles(tmp_path: Path, mode: int) -> None:
    from map_limits import kept

    folder = tmp_path / "kept"
    folder.mkdir()
    folder.chmod(mode)
    with pytest.raises(click.ClickException, match="expected a folder that only you write"):
        kept(tmp_path, folder, lambda: 1)
    assert kept(tmp_path, tmp_path / "mine" / "new", lambda: 2) == 2
    assert (tmp_path / "mine" / "new").stat().st_mode & 0o777 == 0o700
    assert kept(tmp_path, tmp_path / "mine" / "new", lambda: 3) == 2
