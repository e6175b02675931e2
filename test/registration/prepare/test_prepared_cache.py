# SPDX-License-Identifier: Apache-2.0
"""The keyframes that stay made ready, and the memory that they take."""

from __future__ import annotations

import numpy as np

from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.prepare.prepared import AtNeed, prepare
from objreg_ros.registration.prepare.prepared_cache import PreparedCache, held_bytes
from registration.rooms import keyframe, seen_from

PARAMS = RegistrarParams()
VIEWS = [keyframe(seen_from(angle)) for angle in (0.0, 10.0, 20.0)]
BYTES = [held_bytes(prepare(view, PARAMS)) for view in VIEWS]


def test_a_keyframe_is_made_ready_once_and_the_one_that_was_asked_for_longest_ago_goes_first() -> None:
    cache = PreparedCache(PARAMS, sum(BYTES) - 1)
    first, second = (cache.get(view) for view in VIEWS[:2])
    assert cache.get(VIEWS[0]) is first
    cache.get(VIEWS[2])
    assert cache.get(VIEWS[0]) is first and len(cache) == 2
    assert cache.get(VIEWS[1]) is not second


def test_the_cache_is_never_above_its_bytes_after_a_keyframe_was_made_ready() -> None:
    cache = PreparedCache(PARAMS, 2 * max(BYTES))
    for k in range(7):
        cache.get(keyframe(seen_from(10.0 * k)))
        assert cache.nbytes <= cache.most_bytes
    assert len(cache) >= 1


def test_one_that_is_too_large_is_kept_alone() -> None:
    cache = PreparedCache(PARAMS, 1)
    for view in VIEWS:
        assert cache.get(view) is cache.get(view) and len(cache) == 1


def test_what_is_made_later_counts_when_the_next_is_made_ready() -> None:
    cache = PreparedCache(PARAMS, BYTES[0] + BYTES[1])
    ready = cache.get(VIEWS[0])
    before = cache.nbytes
    shape = ready.scene
    assert shape is not None
    assert cache.nbytes > before == BYTES[0]
    assert shape.surface.closest.nbytes + before < cache.nbytes
    cache.get(VIEWS[1])
    assert len(cache) == 1


def test_the_bytes_of_a_value_are_those_of_its_arrays_and_of_what_it_has_made() -> None:
    made = AtNeed(2, lambda _: np.zeros(3))
    assert held_bytes((np.zeros(2), [made, None, "text", 1])) == 16
    assert made[0].size == 3 and held_bytes(made) == 24
