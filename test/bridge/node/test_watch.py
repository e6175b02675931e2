# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

from objreg_ros.bridge.node.watch import Watch


class Clock:
    """A clock that is set by hand."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture(autouse=True)
def without_ros2cli(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shutil.which", lambda name: None)


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


def test_a_silent_input_without_a_publisher_is_reported_with_how_to_remap_it() -> None:
    watch, clock = watched({})
    clock.now = 7.0
    advice = watch.silent()["depth"]
    assert advice.startswith("nothing on /kinect/points or /kinect/depth/image for 7 s: no publisher")
    assert "no publisher; see what the driver publishes, then remap" in advice and "ros2" not in advice
    assert "-r depth/image:=/your/topic" in advice


def test_a_silent_input_with_a_publisher_is_reported_with_a_hint_at_its_qos() -> None:
    watch, clock = watched({"/kinect/points": 1})
    clock.now = 7.0
    assert watch.silent()["depth"].endswith("another QoS: see docs/troubleshooting.md#waits-for-a-topic")


def test_the_commands_of_ros2cli_are_named_where_they_are_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shutil.which", lambda name: f"/opt/ros/jazzy/bin/{name}")
    for publishers, command in [({}, "ros2 topic list"), ({"/kinect/points": 1}, "ros2 topic info -v /kinect/points")]:
        watch, clock = watched(publishers)
        clock.now = 7.0
        assert command in watch.silent()["depth"]


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
