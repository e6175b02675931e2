# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest

from objreg_tools.merge.robot_names import renamed_frame, robot_names


def names(*stores: tuple[str, set[str]]) -> list[dict[str, str]]:
    return robot_names([Path(path) for path, _ in stores], [robots for _, robots in stores])


def test_names_that_one_store_alone_uses_stay() -> None:
    assert names(("a.db", {"robot1", ""}), ("b.db", {"robot2"})) == [{"": "", "robot1": "robot1"}, {"robot2": "robot2"}]


def test_a_name_of_two_stores_is_of_two_robots() -> None:
    found = names(("east.db", {"robot1", ""}), ("west.db", {"robot1", ""}))
    assert found == [{"": "east", "robot1": "east_robot1"}, {"": "west", "robot1": "west_robot1"}]


def test_stores_of_one_name_in_two_folders_have_two_names() -> None:
    assert names(("a/place.db", {""}), ("b/place.db", {""}), ("c.db", {"place_2"})) == [
        {"": "place"},
        {"": "place_3"},
        {"place_2": "place_2"},
    ]


@pytest.mark.parametrize(
    ("path", "name"), [("2026-11-28.db", "store_2026_11_28"), ("Büro.db", "B_ro"), ("ü.db", "store")]
)
def test_a_name_is_one_of_a_namespace(path: str, name: str) -> None:
    assert names((path, {""}), ("other.db", {""}))[0] == {"": name}


def test_a_frame_goes_with_its_robot() -> None:
    assert renamed_frame("robot1/camera", "robot1", "east_robot1") == "east_robot1/camera"
    assert renamed_frame("camera", "", "east") == "east/camera"
    assert renamed_frame("camera", "robot1", "robot1") == "camera"
