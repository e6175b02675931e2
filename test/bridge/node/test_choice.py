# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

from objreg_ros.bridge.node.choice import Choice


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


class Inputs:
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
def inputs() -> Inputs:
    return Inputs()


def test_every_topic_is_open_until_one_is_taken(inputs: Inputs) -> None:
    assert inputs.open == ["raw", "packed"] and inputs.choice.taken is None


def test_the_first_valid_message_decides_and_the_others_are_closed(inputs: Inputs) -> None:
    assert inputs.choice.choose_topic("packed", "good")
    assert inputs.choice.taken == "packed" and inputs.open == ["packed"]
    assert not inputs.choice.choose_topic("raw", "good")


def test_junk_decides_nothing_and_is_handed_on_to_be_counted(inputs: Inputs) -> None:
    assert inputs.choice.choose_topic("packed", "junk")
    assert inputs.choice.taken is None and inputs.open == ["raw", "packed"]
    assert inputs.choice.choose_topic("raw", "good") and inputs.choice.taken == "raw"


def test_once_a_topic_is_taken_junk_on_it_changes_nothing(inputs: Inputs) -> None:
    inputs.choice.choose_topic("raw", "good")
    assert inputs.choice.choose_topic("raw", "junk") and inputs.choice.taken == "raw"


def test_a_topic_that_falls_silent_is_left_for_whichever_speaks_next(inputs: Inputs) -> None:
    inputs.choice.choose_topic("raw", "good")
    inputs.clock.now += 4.9
    inputs.choice.look()
    assert inputs.open == ["raw"]
    inputs.clock.now += 0.1
    inputs.choice.look()
    assert inputs.choice.taken is None and sorted(inputs.open) == ["packed", "raw"]
    assert inputs.choice.choose_topic("packed", "good") and inputs.open == ["packed"]


def test_a_topic_that_speaks_again_after_a_silence_is_taken_again(inputs: Inputs) -> None:
    inputs.choice.choose_topic("raw", "good")
    inputs.clock.now += 6.0
    inputs.choice.look()
    assert inputs.choice.choose_topic("raw", "good") and inputs.open == ["raw"]


def test_a_topic_that_goes_on_speaking_keeps_its_place(inputs: Inputs) -> None:
    for _ in range(4):
        inputs.choice.choose_topic("raw", "good")
        inputs.clock.now += 4.0
        inputs.choice.look()
    assert inputs.choice.taken == "raw"


def test_a_choice_that_is_closed_has_no_subscriptions(inputs: Inputs) -> None:
    inputs.choice.close()
    inputs.choice.close()
    assert inputs.open == [] and not inputs.choice.choose_topic("raw", "good")
