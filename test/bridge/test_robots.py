# SPDX-License-Identifier: Apache-2.0
"""What robots and their frames are called."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from objreg_ros.bridge.robots import framed, prefixes_of, robot_of, unframed


def _node(namespace: str) -> Any:
    return SimpleNamespace(resolve_topic_name=lambda topic, only_expand: f"{namespace}/{topic}".replace("//", "/"))


def test_a_robot_is_called_by_its_whole_namespace_and_its_topics_stay_relative() -> None:
    assert prefixes_of(_node("/fleet"), ["r1", "r2"]) == {"fleet/r1": "r1/", "fleet/r2": "r2/"}
    assert prefixes_of(_node("/"), []) == {"": ""}


def test_a_frame_gets_the_prefix_of_its_robot_once_and_loses_it_again() -> None:
    assert framed("r1", "camera") == framed("r1", "r1/camera") == "r1/camera"
    assert framed("", "camera") == unframed("", "camera") == unframed("r1", "r1/camera") == "camera"
    assert framed("r1", "r10/camera") == "r1/r10/camera"


def test_a_frame_tells_its_robot_by_the_longest_name() -> None:
    robots = ["r1", "fleet", "fleet/r1"]
    told = [robot_of(frame_id, robots) for frame_id in ("r1/camera", "fleet/r1/camera", "r10/camera", "camera")]
    assert told == ["r1", "fleet/r1", "", ""]
