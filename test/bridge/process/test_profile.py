# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import os
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

from objreg_ros.bridge.process import profile
from objreg_ros.share import find

BIGGEST_CLOUD = 640 * 480 * 32  # bytes: XYZRGB as Kinect drivers send it
SPACE = "{http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles}"


def test_our_profile_is_taken_where_the_user_has_none() -> None:
    environment: dict[str, str] = {}
    line = profile.apply(environment)
    assert all(Path(environment[name]).is_file() for name in profile.VARIABLES)
    assert environment[profile.VARIABLES[0]] in line


def test_a_node_takes_its_own_in_the_place_of_ours_that_it_inherits() -> None:
    environment: dict[str, str] = {}
    profile.apply(environment)
    assert profile.NODE in profile.apply(environment, ours=profile.NODE)
    assert {environment[name] for name in profile.VARIABLES} == {str(find(profile.NODE))}
    own = {profile.VARIABLES[0]: "mine"}
    assert "mine" in profile.apply(own, ours=profile.NODE) and own == {profile.VARIABLES[0]: "mine"}


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


def test_the_profile_for_wifi_brings_the_way_of_publishing_that_it_needs() -> None:
    environment = {profile.VARIABLES[1]: str(find(profile.WIFI)), profile.MODE: "SYNCHRONOUS"}
    assert "Wi-Fi" in profile.apply(environment)
    assert {environment[name] for name in profile.VARIABLES} == {str(find(profile.WIFI))}, "whichever the version reads"
    assert environment[profile.MODE] == "AUTO"


NODE = """
import rclpy
rclpy.init()
node = rclpy.create_node("reader_of_a_profile")
with open("/proc/self/maps") as maps:
    spans = [line.split()[0].split("-") for line in maps if "/dev/shm/fastrtps_" in line]
print(max((int(end, 16) - int(start, 16) for start, end in spans), default=0))
"""


def made_with(path: Path, domain: int, mode: str = "AUTO") -> subprocess.CompletedProcess[str]:
    """A node that is made with a profile; it prints the bytes of the greatest shared memory of Fast DDS."""
    pytest.importorskip("rmw_fastrtps_cpp", reason="a profile is read by Fast DDS")
    chosen = dict.fromkeys(profile.VARIABLES, str(path)) | {profile.MODE: mode, "ROS_DOMAIN_ID": str(domain)}
    environment = {**os.environ, "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp", **chosen}
    return subprocess.run([sys.executable, "-c", NODE], env=environment, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("name", "size"), [(profile.PROFILE, 67_108_864), (profile.WIFI, 67_108_864), (profile.NODE, 25_165_824)]
)
def test_fast_dds_reads_the_profile_and_makes_what_it_says(name: str, size: int, domain: int) -> None:
    done = made_with(find(name), domain)
    assert done.returncode == 0 and "Error" not in done.stdout + done.stderr
    assert int(done.stdout.split()[-1]) >= size, "the shared memory of its own profile is 0.5 MB"


def test_fast_dds_says_what_it_cannot_read(tmp_path: Path, domain: int) -> None:
    wrong = tmp_path / "wrong.xml"
    wrong.write_text(find(profile.WIFI).read_text().replace("maxMessageSize", "greatestMessage"))
    done = made_with(wrong, domain)
    assert "greatestMessage" in done.stdout + done.stderr


def test_the_flow_controller_of_the_profile_for_wifi_is_in_force(domain: int) -> None:
    """It refuses a synchronous writer, so a refusal shows that it applies to writers."""
    done = made_with(find(profile.WIFI), domain, mode="SYNCHRONOUS")
    assert done.returncode != 0 and "flow controller" in done.stdout + done.stderr


def test_a_datagram_of_the_profile_for_wifi_fits_a_frame_of_ethernet() -> None:
    sizes = {
        descriptor.findtext(f"{SPACE}type"): int(descriptor.findtext(f"{SPACE}maxMessageSize") or 0)
        for descriptor in ElementTree.parse(find(profile.WIFI)).getroot().iter(f"{SPACE}transport_descriptor")
    }
    assert 0 < sizes["UDPv4"] <= 1500 - 28
