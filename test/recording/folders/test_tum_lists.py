# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest

from objreg_tools.recording.folders.tum_lists import USUAL, are_frame_numbers, pose_columns, read_table, stamp_of


@pytest.mark.parametrize(
    "text", ["0.0 a 1.0 b", "0.0,a,1.0,b", "0.0, a, 1.0, b,", "0.0\ta;1.0\tb\r\n", "\ufeff# x\n0.0 a 1.0 b"]
)
def test_columns_are_parted_as_people_part_them(text: str, tmp_path: Path) -> None:
    (tmp_path / "list.txt").write_bytes(text.encode())
    assert read_table(tmp_path / "list.txt", 4).rows == [["0.0", "a", "1.0", "b"]]


def test_a_first_line_of_names_is_no_row(tmp_path: Path) -> None:
    (tmp_path / "list.csv").write_text("timestamp, frame, x [m], qw []\n1.0, 2, 3, 4\n")
    assert read_table(tmp_path / "list.csv", 4) == ([["1.0", "2", "3", "4"]], ("timestamp", "frame", "x", "qw"))


@pytest.mark.parametrize(
    ("header", "columns"),
    [
        ("# timestamp tx ty tz qx qy qz qw", USUAL),
        ("#timestamp,p_x,p_y,p_z,q_w,q_x,q_y,q_z", (1, 2, 3, 5, 6, 7, 4)),
        ("#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []",
         (1, 2, 3, 5, 6, 7, 4)),
        ("timestamp qw qx qy qz x y z", (5, 6, 7, 2, 3, 4, 1)),
        ("# timestamp tx ty tz qx qy qz qw   (pose in the world; x right, y down, z forward)", USUAL),
        ("# file: 'freiburg1_xyz.bag'", USUAL),
        ("# ground truth trajectory", USUAL),
    ],
)  # fmt: skip
def test_a_header_says_which_column_is_what(header: str, columns: tuple[int, ...], tmp_path: Path) -> None:
    (tmp_path / "truth.txt").write_text(f"# a comment\n{header}\n1 2 3 4 5 6 7 8\n")
    assert pose_columns(read_table(tmp_path / "truth.txt", 8).names) == columns


def test_frames_are_numbered_by_small_whole_numbers() -> None:
    assert are_frame_numbers(["0", "000001", "120"])
    assert not are_frame_numbers(["0", "1.0"]) and not are_frame_numbers(["1403636579763555584"])
    assert not are_frame_numbers(["1700000000"])


def test_nanoseconds_are_read_to_the_last_digit() -> None:
    assert stamp_of("1403636579763555584", Path("a")) == 1403636579763555584 and stamp_of("0.1", Path("a")) == 10**8
