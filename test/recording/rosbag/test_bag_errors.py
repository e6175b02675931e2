# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest

from objreg_tools.recording import open_recording, write_rosbag2
from objreg_tools.recording.rosbag.bag_errors import advice, is_whole_mcap
from recording.sample_folders import records


@pytest.fixture
def mcap(tmp_path: Path) -> Path:
    write_rosbag2(tmp_path / "bag", records())
    return tmp_path / "bag/bag.mcap"


@pytest.mark.parametrize("share", [0.0, 0.01, 0.5, 0.999])
def test_an_mcap_file_is_whole_only_to_its_last_byte(share: float, mcap: Path) -> None:
    assert is_whole_mcap(mcap)
    whole = mcap.read_bytes()
    mcap.write_bytes(whole[: int(len(whole) * share)])
    assert not is_whole_mcap(mcap)


def test_to_recover_is_advised_for_a_file_that_was_cut_only(mcap: Path) -> None:
    assert "mcap recover" not in advice(mcap) and "mcap recover" in advice(mcap, opened=True)
    mcap.write_bytes(mcap.read_bytes()[:-100])
    assert "`mcap recover` saves what is readable" in advice(mcap)


def test_a_whole_file_of_another_profile_is_to_be_converted(mcap: Path) -> None:
    mcap.write_bytes(mcap.read_bytes().replace(b"\x04\0\0\0ros2", b"\x04\0\0\0ros1", 1))
    with pytest.raises(ValueError, match=r"Profile is not ros2; the file is whole, .*'ros1'\); convert it to ROS 2"):
        open_recording(mcap)


@pytest.mark.parametrize("suffix", [".bag", ".mcap", ".db3"])
def test_text_with_the_name_of_a_bag_is_not_to_be_repaired(suffix: str, tmp_path: Path) -> None:
    file = tmp_path / f"x{suffix}"
    file.write_text("hello " * 100)
    assert "whatever its name says" in advice(file)


def test_a_folder_without_its_files_is_to_get_them_back(mcap: Path) -> None:
    mcap.unlink()
    with pytest.raises(ValueError, match=r"put its files back beside metadata\.yaml"):
        open_recording(mcap.parent)
