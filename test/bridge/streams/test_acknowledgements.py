# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

from objreg_ros.bridge.streams.acknowledgements import DEPTH, IMAGE, ORDER, Acknowledgements


def test_depth_is_through_when_the_last_node_has_published_it() -> None:
    acknowledgements = Acknowledgements(ORDER)
    acknowledgements.send(DEPTH, 5)
    acknowledgements.read_acknowledgement("detector published", 5)
    acknowledgements.read_acknowledgement("segmenter published", 5)
    assert acknowledgements.waiting(DEPTH) == 1
    acknowledgements.read_acknowledgement("registrar published", 5)
    assert acknowledgements.waiting(DEPTH) == 0


def test_depth_whose_frame_was_followed_waits_for_the_search_of_its_keyframe() -> None:
    acknowledgements = Acknowledgements(ORDER)
    acknowledgements.send(DEPTH, 5)
    acknowledgements.read_acknowledgement("registrar followed", 5)
    assert acknowledgements.waiting(DEPTH) == 1 and not acknowledgements.outcomes
    acknowledgements.read_acknowledgement("registrar published", 5)
    assert acknowledgements.waiting(DEPTH) == 0


def test_an_image_is_through_when_the_detector_is_done_with_it() -> None:
    acknowledgements = Acknowledgements(ORDER)
    for stamp_ns, verdict in ((4, "detector published"), (5, "detector dropped malformed_image")):
        acknowledgements.send(IMAGE, stamp_ns)
        acknowledgements.read_acknowledgement("segmenter published", stamp_ns)
        assert acknowledgements.waiting(IMAGE) == 1
        acknowledgements.read_acknowledgement(verdict, stamp_ns)
        assert acknowledgements.waiting(IMAGE) == 0


def test_depth_that_is_dropped_on_the_way_is_through() -> None:
    acknowledgements = Acknowledgements(ORDER)
    acknowledgements.send(DEPTH, 5)
    acknowledgements.read_acknowledgement("segmenter dropped unmatched", 5)
    assert acknowledgements.waiting(DEPTH) == 0 and acknowledgements.outcomes["segmenter"] == {"dropped unmatched": 1}


def test_the_last_node_that_is_there_is_the_end() -> None:
    acknowledgements = Acknowledgements({"segmenter", "detector", "mapper"})
    acknowledgements.send(DEPTH, 5)
    acknowledgements.read_acknowledgement("segmenter published", 5)
    assert acknowledgements.waiting(DEPTH) == 0


@pytest.mark.parametrize(("nodes", "kind"), [({"detector"}, DEPTH), ({"segmenter", "registrar"}, IMAGE)])
def test_what_no_node_acknowledges_is_not_waited_for(nodes: set[str], kind: str) -> None:
    acknowledgements = Acknowledgements(nodes)
    acknowledgements.send(kind, 5)
    assert acknowledgements.waiting(kind) == 0


def test_the_same_stamp_may_be_on_its_way_twice() -> None:
    acknowledgements = Acknowledgements(ORDER)
    acknowledgements.send(DEPTH, 5)
    acknowledgements.send(DEPTH, 5)
    acknowledgements.read_acknowledgement("registrar published", 5)
    assert acknowledgements.waiting(DEPTH) == 1


def test_what_is_later_than_a_stamp_is_counted_apart() -> None:
    acknowledgements = Acknowledgements(ORDER)
    for stamp_ns in (5, 6, 7):
        acknowledgements.send(DEPTH, stamp_ns)
    assert acknowledgements.waiting(DEPTH, after_ns=6) == 1 and acknowledgements.waiting(DEPTH) == 3


def test_acknowledgements_of_what_was_not_sent_or_of_strangers_are_left_aside() -> None:
    acknowledgements = Acknowledgements(ORDER)
    acknowledgements.send(DEPTH, 5)
    for text in ("registrar published", "mapper published", "registrar", ""):
        acknowledgements.read_acknowledgement(text, 6)
    assert acknowledgements.waiting(DEPTH) == 1 and acknowledgements.outcomes == {"registrar": {"published": 1}}


def test_what_is_given_up_is_named() -> None:
    acknowledgements = Acknowledgements(ORDER)
    for kind, stamp_ns in ((DEPTH, 7), (DEPTH, 5), (IMAGE, 5)):
        acknowledgements.send(kind, stamp_ns)
    assert (
        acknowledgements.give_up() == [5, 5, 7]
        and acknowledgements.waiting(DEPTH) == acknowledgements.waiting(IMAGE) == 0
    )


def test_without_a_node_of_the_way_there_is_nothing_to_follow() -> None:
    with pytest.raises(ValueError, match="expected one of detector, segmenter, registrar, got mapper"):
        Acknowledgements({"mapper"})
