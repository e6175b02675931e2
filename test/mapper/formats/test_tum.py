# SPDX-License-Identifier: Apache-2.0
"""What is written is what the readers of TUM trajectories expect."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from objreg_mapper.formats.tum import trajectory_text

from .blank import QUARTER_LEFT

HALF = "0.707106781"


def test_a_line_has_the_stamp_to_the_nanosecond_the_position_and_the_quaternion_with_w_last() -> None:
    assert trajectory_text([(1_795_000_000_123_456_789, QUARTER_LEFT)]) == (
        f"1795000000.123456789 1.000000000 2.000000000 3.000000000 0.000000000 0.000000000 {HALF} {HALF}\n"
    )


@pytest.mark.parametrize(
    ("stamp_ns", "seconds"), [(0, "0.000000000"), (-1, "-0.000000001"), (-2_500_000_000, "-2.500000000")]
)
def test_stamps_before_the_epoch_are_written_too(stamp_ns: int, seconds: str) -> None:
    assert trajectory_text([(stamp_ns, np.eye(4))]).split()[0] == seconds


def test_zero_has_no_sign() -> None:
    back = np.eye(4)
    back[:3, 3] = -1e-12
    assert "-" not in trajectory_text([(0, back)])


def test_no_poses_are_an_empty_file() -> None:
    assert trajectory_text([]) == ""


def test_evo_reads_the_poses_that_were_written(tmp_path: Path) -> None:
    interface = pytest.importorskip("evo.tools.file_interface", reason="evo is not installed")
    (tmp_path / "way.tum").write_text(trajectory_text([(0, np.eye(4)), (1_500_000_000, QUARTER_LEFT)]))
    read = interface.read_tum_trajectory_file(tmp_path / "way.tum")
    assert read.timestamps.tolist() == [0.0, 1.5]
    np.testing.assert_allclose(read.poses_se3, [np.eye(4), QUARTER_LEFT], atol=1e-8)
