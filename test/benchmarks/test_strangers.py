# SPDX-License-Identifier: Apache-2.0
"""Tests of how pairs of different places are drawn and forced upon each other."""

from __future__ import annotations

from registration.samples import box, keyframe

CUP, CHAIR = box("cup", (0.0, 0.0, 1.0)), box("chair", (0.0, 0.0, 1.5))


def test_pairs_are_of_two_places_that_share_a_label_and_each_pair_of_places_has_its_share() -> None:
    from strangers import strangers

    places = [[keyframe(k, k, (CUP,)) for k in range(6)], [keyframe(k, k, (CUP, CHAIR)) for k in range(6)]]
    places.append([keyframe(k, k, (CHAIR,)) for k in range(6)])
    drawn = strangers(places, 30, seed=0)
    assert {(a, b) for a, _, b, _ in drawn} == {(0, 1), (1, 2)}  # a cup is no chair
    assert len(drawn) == len(set(drawn)) == 20  # ten for each of three pairs of places, one of which has none
    assert strangers(places, 30, seed=0) == drawn != strangers(places, 30, seed=1)


def test_a_pair_of_different_rooms_is_refused_with_a_reason() -> None:
    import strangers

    strangers._begin([[keyframe(1, 1, (CUP,))], [keyframe(2, 2, (CHAIR,))]])
    ((reason, _),) = strangers.tried([(0, 0, 1, 0)])
    assert reason == "few_objects_matched"  # the same walls, and a chair in the stead of the cup
