# SPDX-License-Identifier: Apache-2.0
"""What training pictures are made of, and that validation shares nothing with them."""

from __future__ import annotations

from collections import Counter

import numpy as np

from training.labels import LABELS
from training.render import samples
from training.scenes import LOOK_ALIKES, desk, hard_scene, plain_scene, wild, with_look_alikes
from training.validation import FIRST_SCENE, pictures


def test_a_desk_has_what_a_desk_needs() -> None:
    found = {placed.label for placed in desk(np.random.default_rng(1)).objects}
    assert {"monitor", "keyboard", "mouse", "chair"} <= found


def test_a_wild_scene_has_some_of_the_nine_classes() -> None:
    assert any(not placed.is_distractor for placed in wild(np.random.default_rng(2)).objects)


def test_three_of_ten_objects_of_hard_scenes_and_more_are_flashlights_and_books() -> None:
    rng = np.random.default_rng(3)
    scenes = [hard_scene(rng)[0] for _ in range(6)]
    found = Counter(placed.label for scene in scenes for placed in scene.objects if not placed.is_distractor)
    assert found["flashlight"] + found["book"] > 0.3 * found.total()  # of ordinary rooms they are less than a quarter


def test_look_alikes_take_the_places_of_other_distractors_and_leave_the_objects_alone() -> None:
    scene = plain_scene(np.random.default_rng(4))[0]
    changed = with_look_alikes(scene, np.random.default_rng(4))
    pairs = list(zip(scene.objects, changed.objects, strict=True))
    assert all(np.array_equal(a.T_world_object, b.T_world_object) for a, b in pairs)
    replaced = [(a, b) for a, b in pairs if a.model is not b.model]
    assert replaced and all(a.is_distractor and b.is_distractor for a, b in replaced)
    assert {b.label for _, b in replaced} <= set(LOOK_ALIKES)


def test_pictures_of_one_scene_have_boxes_inside_and_known_classes() -> None:
    rng = np.random.default_rng(5)
    pictures_of_a_scene = list(samples(rng))
    assert sum(len(sample.boxes) for sample in pictures_of_a_scene) > 0
    for sample in pictures_of_a_scene:
        height, width = sample.rgb.shape[:2]
        assert (sample.boxes >= 0).all() and (sample.boxes <= [width, height, width, height]).all()
        assert set(sample.classes.tolist()) <= set(range(len(LABELS)))


def test_validation_repeats_itself_and_lies_beyond_the_training_seeds() -> None:
    assert FIRST_SCENE >= 2**31  # training draws below
    first, again = next(pictures(seed=4, count=1)), next(pictures(seed=4, count=1))
    assert np.array_equal(first.rgb, again.rgb) and np.array_equal(first.boxes, again.boxes)
    assert not np.array_equal(first.rgb, next(pictures(seed=5, count=1)).rgb)


def test_validation_is_the_same_in_other_processes() -> None:
    here, there = pictures(seed=4, count=2), pictures(seed=4, count=2, processes=2)
    for one, other in zip(here, there, strict=True):
        assert np.array_equal(one.rgb, other.rgb) and np.array_equal(one.boxes, other.boxes)
