# SPDX-License-Identifier: Apache-2.0
"""Tests of closures that share the errors of their keyframes."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.simulation.walk import WalkParams, walk
from objreg_ros.truth import Truth


@pytest.fixture(autouse=True)
def _gtsam() -> None:
    pytest.importorskip("gtsam", reason="the map is solved with gtsam")


def test_pictures_that_are_not_off_change_nothing_and_those_that_are_do() -> None:
    from map_lies import filled
    from map_peers import PEERS, Dense
    from map_shared import Sigmas, errors_cm, with_pictures

    words = walk(WalkParams(poses=120, closures=25, corridor_m=2.0), 3)
    graph = filled(words, right_only=True)[0]
    dense = Dense.of(graph)
    plain = PEERS["GTSAM LM"](dense, 0.0).poses
    assert np.allclose(with_pictures(dense, Sigmas(1e-5, 1e-3)), plain, atol=2e-3)
    assert not np.allclose(with_pictures(dense, Sigmas(0.1, 5.0)), plain, atol=2e-3)
    truth = Truth((word.stamp_ns, T) for word, T in zip(words.odometry, words.T_world_body, strict=True))
    told = errors_cm(graph, truth)
    assert len(told) == 5 and all(0.0 < value < 100.0 for value in told.values())
