# SPDX-License-Identifier: Apache-2.0
"""What a box holds: taken apart, and put together."""

from __future__ import annotations

from objreg_ros.segmenter.segment import Segmenter
from segmenter.scenes import Scene

NOISE = 0.0015


def shares(scene: Scene, box: tuple[float, float, float, float]) -> dict[int, float]:
    """Which share of every thing of a scene is in the object of a box."""
    thing = Segmenter().segment(scene.detections(box), scene.image(NOISE)).objects[0]
    got = scene.pixels(thing.xyz)
    owners = range(1, scene.count + 1)
    return {k: float((got & (scene.owner == k)).sum() / max(1, (scene.owner == k).sum())) for k in owners}


def test_a_box_that_holds_two_gives_one_of_them() -> None:
    scene = Scene().plane().box((-0.2, 0, 0), (-0.05, 0.1, 0.15)).box((0.05, 0, 0), (0.2, 0.1, 0.15))
    found = shares(scene, scene.box_of(2, 3))
    assert sorted((found[2] > 0.9, found[3] > 0.9)) == [False, True]
    assert min(found[2], found[3]) < 0.05


def test_two_parts_of_one_colour_and_distance_that_fill_a_box_are_one_thing() -> None:
    scene = Scene().plane().box((-0.6, 0, 0), (-0.55, 0.05, 0.05)).box((0.55, 0, 0), (0.6, 0.05, 0.05))
    scene = scene.box((-0.2, 0, 0.2), (-0.05, 0.05, 0.35)).box((0.1, 0, 0), (0.25, 0.05, 0.15))  # both of one colour
    found = shares(scene, scene.box_of(4, 5))
    assert min(found[4], found[5]) > 0.9


def test_stacked_boxes_are_taken_apart() -> None:
    scene = Scene(tilt_deg=45).plane().box((-0.15, -0.1, 0), (0.15, 0.15, 0.08))
    scene = scene.box((-0.08, -0.02, 0.08), (0.08, 0.12, 0.16))
    lower = shares(scene, scene.box_of(2, pad=0.02))
    upper = shares(scene, scene.box_of(3, pad=0.02))
    assert lower[2] > 0.85 > 0.3 > lower[3]
    assert upper[3] > 0.85 > 0.2 > upper[2]


def test_an_object_behind_another_is_found_by_its_own_box() -> None:
    scene = Scene().plane().box((-0.2, 0.2, 0), (0.2, 0.26, 0.25)).box((-0.05, 0, 0), (0.05, 0.06, 0.15))
    found = shares(scene, scene.box_of(2))
    assert found[2] > 0.9
    assert found[3] < 0.1


def test_the_inside_of_a_hollow_thing_belongs_to_it_whatever_its_colour() -> None:
    scene = Scene(tilt_deg=45).plane().box((-0.12, 0.03, 0), (0.12, 0.22, 0.085)).box((-0.12, 0, 0), (0.12, 0.01, 0.11))
    found = shares(scene, scene.box_of(2, 3))
    assert min(found[2], found[3]) > 0.9


def test_a_narrow_thing_before_a_wide_one_is_not_added_to_it() -> None:
    scene = Scene().plane().box((-0.1, 0, 0), (0.1, 0.08, 0.2)).box((-0.03, -0.09, 0), (0.03, -0.03, 0.1))
    found = shares(scene, scene.box_of(2, 3))
    assert found[2] > 0.85
    assert found[3] < 0.05
