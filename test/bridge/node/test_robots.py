# SPDX-License-Identifier: Apache-2.0
"""What robots are called."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from objreg_ros.bridge.node.robots import prefixes_of


def _node(namespace: str) -> Any:
    return SimpleNamespace(resolve_topic_name=lambda topic, only_expand: f"{namespace}/{topic}".replace("//", "/"))


def test_a_robot_is_called_by_its_whole_namespace_and_its_topics_stay_relative() -> None:
    assert prefixes_of(_node("/fleet"), ["r1", "r2"]) == {"fleet/r1": "r1/", "fleet/r2": "r2/"}
    assert prefixes_of(_node("/"), []) == {"": ""}
