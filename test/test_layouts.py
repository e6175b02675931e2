# SPDX-License-Identifier: Apache-2.0
"""The layouts for RViz and Foxglove show topics that the graph has, as what they are."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

PLUGIN = "rviz_default_plugins/"
SHOWN_AS = {  # the display of RViz → the type of message that it takes
    "Image": "sensor_msgs/Image",
    "PointCloud2": "sensor_msgs/PointCloud2",
    "MarkerArray": "visualization_msgs/MarkerArray",
    "Path": "nav_msgs/Path",
    "Odometry": "nav_msgs/Odometry",
    "PoseWithCovariance": "geometry_msgs/PoseWithCovarianceStamped",
}
OF_MOMENTS = "constraints"  # its frames are no frames of TF: nothing can place it
LOOKS = {"visible", "pointSize", "colorMode", "colorField", "colorMap"}
IN_SPACE = {"followMode", "followTf", "scene", "cameraState", "transforms", "topics", "layers", "publish", "imageMode"}
SETTINGS = {  # the panel of Foxglove → what it reads of its settings
    "3D": IN_SPACE,
    "Image": IN_SPACE,
    "DiagnosticSummary": {"topicToRender", "minLevel", "pinnedIds", "hardwareIdFilter", "sortByLevel"},
    "RawMessages": {"topicPath", "diffEnabled", "diffMethod", "diffTopicPath", "showFullMessageForDiff"},
}
LATCHED = {"markers", "path", "relocalised"}


@pytest.fixture(scope="module")
def topics(repository: Path) -> dict[str, str]:
    """What the table of topics in docs/wire.md says of each: its row."""
    table = (repository / "docs/wire.md").read_text(encoding="utf-8").partition("## Topics")[2].partition("\n## ")[0]
    rows = [line.split(" | ") for line in table.splitlines() if line.startswith("| `")]
    return {name: " | ".join(row[1:]) for row in rows for name in re.findall(r"`([\w/]+)`", row[0])}


@pytest.fixture(scope="module")
def displays(repository: Path) -> list[dict[str, Any]]:
    layout = yaml.safe_load((repository / "config/objreg.rviz").read_text(encoding="utf-8"))
    assert layout["Visualization Manager"]["Global Options"]["Fixed Frame"] == "odom"
    return layout["Visualization Manager"]["Displays"]


@pytest.fixture(scope="module")
def foxglove(repository: Path) -> dict[str, Any]:
    return json.loads((repository / "config/foxglove.json").read_text(encoding="utf-8"))


def panels(node: Any) -> Iterator[str]:
    """The panels of a layout: a name, or two parts with a direction."""
    if isinstance(node, str):
        yield node
        return
    assert set(node) == {"direction", "first", "second", "splitPercentage"}
    assert node["direction"] in ("row", "column") and 0 < node["splitPercentage"] < 100
    yield from panels(node["first"])
    yield from panels(node["second"])


def test_rviz_shows_topics_of_the_graph_in_any_namespace_as_what_they_are(
    displays: list[dict[str, Any]], topics: dict[str, str]
) -> None:
    shown = {display["Topic"]["Value"]: display for display in displays if "Topic" in display}
    assert {"objects", "view", "markers", "path", "odom"} <= set(shown) <= set(topics) - {OF_MOMENTS}
    for topic, display in shown.items():
        assert topics[topic].startswith(SHOWN_AS[display["Class"].removeprefix(PLUGIN)]), topic
        assert (display["Topic"].get("Durability Policy") == "Transient Local") == (topic in LATCHED), topic
    assert f"{PLUGIN}TF" in {display["Class"] for display in displays}


def test_every_panel_of_foxglove_has_its_place_and_its_settings(foxglove: dict[str, Any]) -> None:
    placed = list(panels(foxglove["layout"]))
    assert sorted(placed) == sorted(foxglove["configById"])
    assert {name.partition("!")[0] for name in placed} == {"3D", "Image", "DiagnosticSummary", "RawMessages"}
    assert {"globalVariables", "userNodes", "playbackConfig"} <= set(foxglove)


def test_foxglove_reads_every_setting_that_a_panel_has(foxglove: dict[str, Any]) -> None:
    for name, settings in foxglove["configById"].items():
        assert set(settings) <= SETTINGS[name.partition("!")[0]], name
        assert all(set(looks) <= LOOKS for looks in settings.get("topics", {}).values()), name


def test_foxglove_shows_topics_of_the_graph(foxglove: dict[str, Any], topics: dict[str, str]) -> None:
    named = {topic for panel in foxglove["configById"].values() for topic in panel.get("topics", ())}
    assert "/" + OF_MOMENTS not in named
    named |= {panel["imageMode"]["imageTopic"] for panel in foxglove["configById"].values() if panel.get("imageMode")}
    named |= {panel[key] for panel in foxglove["configById"].values() for key in ("topicPath", "topicToRender")
              if key in panel}  # fmt: skip
    known = {topic if topic.startswith("/") else f"/{topic}" for topic in topics}
    assert {"/refusals", "/diagnostics", "/image", "/objects"} <= named <= known
