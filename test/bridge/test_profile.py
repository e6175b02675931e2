# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

from objreg_ros.bridge import profile
from objreg_ros.share import find

BIGGEST_CLOUD = 640 * 480 * 32  # bytes: XYZRGB as Kinect drivers send it
SPACE = "{http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles}"


def test_our_profile_is_taken_where_the_user_has_none() -> None:
    environment: dict[str, str] = {}
    line = profile.apply(environment)
    assert all(Path(environment[name]).is_file() for name in profile.VARIABLES)
    assert environment[profile.VARIABLES[0]] in line


def test_it_says_the_same_in_a_process_that_inherits_it() -> None:
    environment: dict[str, str] = {}
    assert profile.apply(environment) == profile.apply(environment)


@pytest.mark.parametrize("name", [*profile.VARIABLES, profile.TRANSPORTS])
def test_the_users_own_choice_stays_and_is_said(name: str) -> None:
    environment = {name: "mine"}
    assert f"{name}=mine" in profile.apply(environment)
    assert environment == {name: "mine"}


def test_another_middleware_is_left_alone() -> None:
    environment = {"RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"}
    assert "rmw_cyclonedds_cpp" in profile.apply(environment)
    assert len(environment) == 1


def test_the_profile_holds_several_of_the_biggest_clouds_and_keeps_a_way_to_other_machines() -> None:
    root = ElementTree.parse(find(profile.PROFILE)).getroot()
    descriptors = {d.findtext(f"{SPACE}type"): d for d in root.iter(f"{SPACE}transport_descriptor")}
    assert set(descriptors) == {"SHM", "UDPv4"}
    assert int(descriptors["SHM"].findtext(f"{SPACE}segment_size") or 0) > 5 * BIGGEST_CLOUD
    assert int(descriptors["SHM"].findtext(f"{SPACE}maxMessageSize") or 0) > BIGGEST_CLOUD
