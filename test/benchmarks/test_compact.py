# SPDX-License-Identifier: Apache-2.0
"""Tests of the figures of packed keyframes."""

from __future__ import annotations

import numpy as np

from objreg_ros.keyframes.fusion import fuse
from objreg_ros.keyframes.keyframer import FrameWindow
from objreg_ros.registrar.params import RegistrarParams
from objreg_tools.simulation.drawn_place import drawn


def test_sizes_are_given_whole_and_within_the_bound_with_what_came_back() -> None:
    from compact import sizes

    keyframes = [fuse(FrameWindow.of(drawn(stamp_ns)), RegistrarParams()) for stamp_ns in (0, 1)]
    figures, back = sizes(keyframes, most_bytes=1)
    assert [keyframe.stamp_ns for keyframe in back] == [0, 1]
    assert 0 < figures["bytes"]["median"] < figures["bytes_whole"]["median"] <= figures["bytes_whole"]["most"]
    points = sum(len(item.cloud) for item in keyframes[0].objects)
    assert figures["points_kept"] == 400 / points and figures["descriptor"] > 0.0


def test_errors_are_those_of_pairs_that_both_ways_accept() -> None:
    from compact import compared
    from frame_pairs import Pair
    from pair_figures import Row

    pairs = [Pair(0, 1, np.eye(4), 5.0, True)] * 3 + [Pair(0, 1, np.eye(4), 5.0, False)]
    before = [
        Row((1.0, 1.0), True, 1.0),
        Row((0.2, 9.0), True, 1.0),
        Row((0.1, 0.1), False, 1.0),
        Row(None, False, 1.0),
    ]
    after = [Row((2.0, 4.0), True, 1.0), Row((0.2, 1.0), False, 1.0), Row((3.0, 0.1), False, 1.0), before[1]]
    figures = compared(pairs, before, after)
    assert figures["both_accept"] == 1 and figures["verdicts_changed"] == 2
    assert (figures["as_it_was"]["translation_cm"], figures["as_it_came"]["translation_cm"]) == (1.0, 4.0)
    assert (figures["as_it_was"]["wrong"], figures["as_it_came"]["wrong"]) == (0, 0)
    assert figures["as_it_was"]["accepted_recall"] == 2 / 3 and figures["as_it_came"]["accepted_recall"] == 1 / 3
