# SPDX-License-Identifier: Apache-2.0
"""Tests of what a pose says of the objects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.data.frames import View
from objreg_ros.geometry import inverse, pose
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.prepare.prepared import prepare
from objreg_ros.registration.propose.evidence import NEARBY_M
from objreg_ros.registration.score.object_matches import is_gone, match_objects, score_matched_silhouettes
from registration import samples
from registration.rooms import CAMERA, ROOM, keyframe, seen_from

PARAMS = RegistrarParams()


def test_the_middle_of_a_large_thing_may_wander_with_the_side_that_is_seen() -> None:
    here = prepare(keyframe(seen_from(0.0), seed=1), PARAMS)
    aside = pose(np.eye(3), np.array([0.13, 0.0, 0.0]))

    def matched(extent: float) -> int:
        grown = replace(here, extents=np.full(len(here.extents), extent))
        return len(match_objects(grown, grown, aside)[0])

    assert matched(0.1) == 0 and matched(1.0) == len(here.groups)


def test_an_object_has_moved_where_each_view_looks_through_where_the_other_saw_it() -> None:
    elsewhere = ("bottle", (1.5, 0.6, 0.72), (1.58, 0.68, 1.0))
    later = tuple(elsewhere if box[0] == "bottle" else box for box in ROOM)
    here, aside = seen_from(0.0), seen_from(20.0)
    now, then = (prepare(keyframe(*seen, seed=k), PARAMS) for k, seen in enumerate(((here, later), (aside, ROOM))))
    T_then_now = inverse(aside) @ here
    for source, target, T in ((now, then, T_then_now), (then, now, inverse(T_then_now))):
        matched, moved = match_objects(source, target, T)
        assert {pair.label for pair in matched} == {"book", "cup", "keyboard"}
        assert [pair.label for pair in moved] == ["bottle"]


@pytest.mark.parametrize("there_first", [True, False])
def test_an_object_that_still_stands_undetected_has_not_moved_to_where_another_came(there_first: bool) -> None:
    bottle = ("bottle", (1.5, 0.6, 0.72), (1.58, 0.68, 1.0))
    here, aside = seen_from(0.0), seen_from(20.0)
    seen = keyframe(here, (*ROOM, bottle), seed=1)
    known = next(item for item in seen.objects if item.cloud.label == "bottle")
    undetected = replace(seen, objects=tuple(item for item in seen.objects if item is not known))
    views = [prepare(key, PARAMS) for key in (keyframe(aside, seed=2), undetected)]
    T = inverse(here) @ aside
    matched, moved = match_objects(*(views if there_first else views[::-1]), T if there_first else inverse(T))
    assert {pair.label for pair in matched} == {"book", "cup", "keyboard"} and moved == ()


@pytest.mark.parametrize(
    ("seen", "through", "gone"), [(1.0, 0.7, True), (0.6, 0.6, True), (0.4, 0.4, False), (1.0, 0.3, False)]
)
def test_an_object_is_gone_where_half_of_it_is_seen_and_most_of_that_looked_through(
    seen: float, through: float, gone: bool
) -> None:
    v, u = np.mgrid[0:120, 0:160]
    rays = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones_like(u, float)], axis=-1)
    wall = np.where(u[..., None] < 80, 2.0 * rays, np.nan).astype(np.float32)
    share = np.linspace(0.0, 1.0, 400)
    pixels = rays[60, np.where(share < seen, 40, 120)]
    thing = samples.cloud("cup", pixels * np.where(share < through, 1.0, 2.0)[:, None])
    owner = replace(samples.keyframe(objects=(thing,)), view=View(xyz=wall, grey=None, intrinsics=CAMERA))
    prepared = prepare(owner, PARAMS)
    assert is_gone(prepared, 0, prepared, np.eye(4)) is gone


def test_an_object_a_little_aside_looks_more_alike_within_reach_than_where_it_is() -> None:
    here, there = (prepare(keyframe(seen_from(0.0), seed=seed), PARAMS) for seed in (1, 2))
    aside = pose(np.eye(3), np.array([0.04, 0.0, 0.0]))
    matched, _ = match_objects(here, there, aside)
    where = score_matched_silhouettes(here, there, matched, aside)
    what = score_matched_silhouettes(here, there, matched, aside, NEARBY_M)
    assert matched and where is not None and what is not None
    assert where < what - 0.2
