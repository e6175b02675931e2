# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

from objreg_ros.bridge.streams.receipts import DEPTH, IMAGE, ORDER, Receipts


def test_depth_is_through_when_the_last_node_has_published_it() -> None:
    receipts = Receipts(ORDER)
    receipts.send(DEPTH, 5)
    receipts.hear("detector published", 5)
    receipts.hear("segmenter published", 5)
    assert receipts.waiting(DEPTH) == 1
    receipts.hear("registrar published", 5)
    assert receipts.waiting(DEPTH) == 0


def test_an_image_is_through_when_the_detector_is_done_with_it() -> None:
    receipts = Receipts(ORDER)
    for stamp_ns, verdict in ((4, "detector published"), (5, "detector dropped malformed_image")):
        receipts.send(IMAGE, stamp_ns)
        receipts.hear("segmenter published", stamp_ns)
        assert receipts.waiting(IMAGE) == 1
        receipts.hear(verdict, stamp_ns)
        assert receipts.waiting(IMAGE) == 0


def test_depth_that_is_dropped_on_the_way_is_through() -> None:
    receipts = Receipts(ORDER)
    receipts.send(DEPTH, 5)
    receipts.hear("segmenter dropped unmatched", 5)
    assert receipts.waiting(DEPTH) == 0 and receipts.outcomes["segmenter"] == {"dropped unmatched": 1}


def test_the_last_node_that_is_there_is_the_end() -> None:
    receipts = Receipts({"segmenter", "detector", "mapper"})
    receipts.send(DEPTH, 5)
    receipts.hear("segmenter published", 5)
    assert receipts.waiting(DEPTH) == 0


@pytest.mark.parametrize(("nodes", "kind"), [({"detector"}, DEPTH), ({"segmenter", "registrar"}, IMAGE)])
def test_what_no_node_receipts_is_not_waited_for(nodes: set[str], kind: str) -> None:
    receipts = Receipts(nodes)
    receipts.send(kind, 5)
    assert receipts.waiting(kind) == 0


def test_the_same_stamp_may_be_on_its_way_twice() -> None:
    receipts = Receipts(ORDER)
    receipts.send(DEPTH, 5)
    receipts.send(DEPTH, 5)
    receipts.hear("registrar published", 5)
    assert receipts.waiting(DEPTH) == 1


def test_what_is_later_than_a_stamp_is_told_apart() -> None:
    receipts = Receipts(ORDER)
    for stamp_ns in (5, 6, 7):
        receipts.send(DEPTH, stamp_ns)
    assert receipts.waiting(DEPTH, after_ns=6) == 1 and receipts.waiting(DEPTH) == 3


def test_receipts_of_what_was_not_sent_or_of_strangers_are_left_aside() -> None:
    receipts = Receipts(ORDER)
    receipts.send(DEPTH, 5)
    for text in ("registrar published", "mapper published", "registrar", ""):
        receipts.hear(text, 6)
    assert receipts.waiting(DEPTH) == 1 and receipts.outcomes == {"registrar": {"published": 1}}


def test_what_is_given_up_is_named() -> None:
    receipts = Receipts(ORDER)
    for kind, stamp_ns in ((DEPTH, 7), (DEPTH, 5), (IMAGE, 5)):
        receipts.send(kind, stamp_ns)
    assert receipts.give_up() == [5, 5, 7] and receipts.waiting(DEPTH) == receipts.waiting(IMAGE) == 0


def test_without_a_node_of_the_way_there_is_nothing_to_follow() -> None:
    with pytest.raises(ValueError, match="expected one of detector, segmenter, registrar, got mapper"):
        Receipts({"mapper"})
