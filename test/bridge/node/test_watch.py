# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from objreg_ros.bridge.node.watch import Watch


class Clock:
    """A clock that is set by hand."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


def watched(publishers: dict[str, int]) -> tuple[Watch, Clock]:
    clock = Clock()
    watch = Watch(lambda topic: publishers.get(topic, 0), period_s=5.0, clock=clock)
    watch.expect("depth", {"points": "/kinect/points", "depth/image": "/kinect/depth/image"})
    return watch, clock


def test_an_input_that_speaks_in_time_is_not_reported() -> None:
    watch, clock = watched({})
    clock.now = 4.9
    assert watch.silent() == {}
    watch.note_input("depth")
    clock.now = 9.8
    assert watch.silent() == {}


def test_a_silent_input_without_a_publisher_is_told_how_to_be_remapped() -> None:
    watch, clock = watched({})
    clock.now = 7.0
    advice = watch.silent()["depth"]
    assert advice.startswith("nothing on /kinect/points or /kinect/depth/image for 7 s: no publisher")
    assert "ros2 topic list" in advice and "-r depth/image:=/your/topic" in advice


def test_a_silent_input_with_a_publisher_is_told_to_look_at_its_qos() -> None:
    watch, clock = watched({"/kinect/points": 1})
    clock.now = 7.0
    assert "ros2 topic info -v /kinect/points" in watch.silent()["depth"]


def test_an_input_that_is_not_watched_may_speak() -> None:
    watch, clock = watched({})
    watch.note_input("odom")
    clock.now = 7.0
    assert set(watch.silent()) == {"depth"}


def test_a_forgotten_input_may_be_silent() -> None:
    watch, clock = watched({})
    watch.unwatch("depth")
    watch.unwatch("odom")
    clock.now = 7.0
    assert watch.silent() == {}
