# SPDX-License-Identifier: Apache-2.0
"""What training pictures are made of, and that validation shares nothing with them."""

from __future__ import annotations

import numpy as np

from training.labels import LABELS
from training.render import samples
from training.scenes import desk, wild
from training.validation import FIRST_SCENE, pictures


def test_a_desk_has_what_a_desk_needs() -> None:
    found = {placed.label for placed in desk(np.random.default_rng(1)).objects}
    assert {"monitor", "keyboard", "mouse", "chair"} <= found


def test_a_wild_scene_has_some_of_the_nine_classes() -> None:
    assert any(not placed.is_distractor for placed in wild(np.random.default_rng(2)).objects)


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
