# SPDX-License-Identifier: Apache-2.0
"""A keyframe made ready: what it holds, that it is always the same, and who keeps it."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.prepare.prepared import AtNeed, prepare
from registration.rooms import keyframe, seen_from

PARAMS = RegistrarParams()
HERE = keyframe(seen_from(0.0))


def test_a_keyframe_is_made_ready_the_same_every_time_and_by_any_number_of_threads() -> None:
    with ThreadPoolExecutor(3) as pool:
        first, *others = pool.map(lambda _: prepare(HERE, PARAMS), range(3))
    for other in others:
        assert np.array_equal(first.surface.closest, other.surface.closest)
        assert np.array_equal(first.features.histograms, other.features.histograms)
        assert np.array_equal(first.xyz, other.xyz)


def test_every_object_has_a_shape_and_a_middle_and_all_of_them_one_together() -> None:
    ready = prepare(HERE, PARAMS)
    assert len(ready.shapes) == len(ready.centroids) == len(ready.extents) == len(HERE.objects) > 1
    assert ready.scene is not None and None not in ready.shapes


def test_what_is_known_of_single_objects_is_made_once_and_when_it_is_asked_for() -> None:
    asked: list[int] = []
    things = AtNeed(3, lambda k: (asked.append(k), 10 * k)[1])
    assert len(things) == 3 and asked == []
    assert (things[2], things[2], asked) == (20, 20, [2])
    assert list(things) == [0, 10, 20] and list(things[:2]) == [0, 10] and asked == [2, 0, 1]


def test_the_first_points_are_a_fair_sample_of_all() -> None:
    xyz = prepare(HERE, PARAMS).xyz
    few = xyz[: len(xyz) // 4]
    assert np.abs(few.mean(axis=0) - xyz.mean(axis=0)).max() < 0.15
    assert np.abs(few.std(axis=0) - xyz.std(axis=0)).max() < 0.15


def test_without_gravity_nothing_is_upright() -> None:
    ready = prepare(keyframe(seen_from(0.0), gravity=False), PARAMS)
    assert ready.up is None and ready.scene is None
    assert set(ready.shapes) == {None} and not any(ready.yaw_known)
