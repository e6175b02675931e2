# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

from objreg_ros.bridge.node.choice import Choice


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


class Hall:
    """Knows which topics are subscribed to."""

    def __init__(self) -> None:
        self.open: list[str] = []
        self.clock = Clock()
        self.choice = Choice(("raw", "packed"), self.enter, self.open.remove, self.is_valid, 5.0, self.clock)

    def enter(self, topic: str) -> str:
        self.open.append(topic)
        return topic

    @staticmethod
    def is_valid(topic: str, message: str) -> bool:
        return message != "junk"


@pytest.fixture
def hall() -> Hall:
    return Hall()


def test_every_topic_is_open_until_one_is_taken(hall: Hall) -> None:
    assert hall.open == ["raw", "packed"] and hall.choice.taken is None


def test_the_first_valid_message_decides_and_the_others_are_closed(hall: Hall) -> None:
    assert hall.choice.choose_topic("packed", "good")
    assert hall.choice.taken == "packed" and hall.open == ["packed"]
    assert not hall.choice.choose_topic("raw", "good")


def test_junk_decides_nothing_and_is_handed_on_to_be_counted(hall: Hall) -> None:
    assert hall.choice.choose_topic("packed", "junk")
    assert hall.choice.taken is None and hall.open == ["raw", "packed"]
    assert hall.choice.choose_topic("raw", "good") and hall.choice.taken == "raw"


def test_once_a_topic_is_taken_junk_on_it_changes_nothing(hall: Hall) -> None:
    hall.choice.choose_topic("raw", "good")
    assert hall.choice.choose_topic("raw", "junk") and hall.choice.taken == "raw"


def test_a_topic_that_falls_silent_makes_room_for_whichever_speaks_next(hall: Hall) -> None:
    hall.choice.choose_topic("raw", "good")
    hall.clock.now += 4.9
    hall.choice.look()
    assert hall.open == ["raw"]
    hall.clock.now += 0.1
    hall.choice.look()
    assert hall.choice.taken is None and sorted(hall.open) == ["packed", "raw"]
    assert hall.choice.choose_topic("packed", "good") and hall.open == ["packed"]


def test_a_topic_that_speaks_again_after_a_silence_is_taken_again(hall: Hall) -> None:
    hall.choice.choose_topic("raw", "good")
    hall.clock.now += 6.0
    hall.choice.look()
    assert hall.choice.choose_topic("raw", "good") and hall.open == ["raw"]


def test_a_topic_that_goes_on_speaking_keeps_its_place(hall: Hall) -> None:
    for _ in range(4):
        hall.choice.choose_topic("raw", "good")
        hall.clock.now += 4.0
        hall.choice.look()
    assert hall.choice.taken == "raw"


def test_a_choice_that_is_closed_has_no_subscriptions(hall: Hall) -> None:
    hall.choice.close()
    hall.choice.close()
    assert hall.open == [] and not hall.choice.choose_topic("raw", "good")
