# SPDX-License-Identifier: Apache-2.0
"""What is remembered of one landmark."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from objreg_ros.memory.known import Viewpoints


def test_viewpoints_are_what_a_dictionary_of_arrays_would_hold() -> None:
    draw, seen = np.random.default_rng(0), Viewpoints()
    model: dict[int, np.ndarray] = {}
    for _ in range(300):
        number = int(draw.integers(20))
        if number in model and draw.random() < 0.4:
            del model[number], seen[number]
        else:
            model[number] = seen[number] = draw.normal(size=3)
        assert list(seen) == list(model) and len(seen) == len(model)
        assert all(np.array_equal(seen[k], model[k]) for k in model)


def test_a_keyframe_that_did_not_see_it_has_no_viewpoint() -> None:
    seen = Viewpoints()
    seen[3] = np.zeros(3)
    assert 3 in seen and 4 not in seen and seen.get(4) is None
    with pytest.raises(KeyError):
        seen[4]
    with pytest.raises(KeyError):
        del seen[4]


def test_a_viewpoint_that_is_changed_outside_stays_as_it_was() -> None:
    seen, point = Viewpoints(), np.ones(3)
    seen[1] = point
    point[:] = 0.0
    seen[1][:] = 2.0
    assert seen[1].tolist() == [1.0, 1.0, 1.0]


def test_the_viewpoints_of_eight_keyframes_take_half_a_kilobyte() -> None:
    tracemalloc.start()
    many = [Viewpoints() for _ in range(100)]
    for seen in many:
        for k in range(8):
            seen[1000 + k] = np.full(3, float(k))
    now, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert now < 100 * 600
