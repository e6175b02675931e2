# SPDX-License-Identifier: Apache-2.0
"""The ends of a bad link, without the link: what one sends the other writes down."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

LIMIT_S = 60


@pytest.mark.ros
def test_a_receiver_writes_the_number_and_the_age_of_each_message(repository: Path, tmp_path: Path) -> None:
    pytest.importorskip("rclpy", reason="the ends are nodes of ROS 2")
    command = [sys.executable, str(repository / "benchmarks/wireless_ends.py")]
    received, met = tmp_path / "received", tmp_path / "met"
    receiver = subprocess.Popen([*command, "receive", str(received)])
    try:
        sending = [*command, "send", "3", "--size", "1000", "--hz", "20", "--linger", "0.5", "--met", str(met)]
        subprocess.run(sending, check=True, timeout=LIMIT_S)
    finally:
        receiver.send_signal(signal.SIGINT)
        receiver.wait(LIMIT_S)
    lines = [line.split() for line in received.read_text().splitlines()]
    assert [number for number, _ in lines] == ["0", "1", "2"] and all(0.0 <= float(age) < LIMIT_S for _, age in lines)
    assert met.exists() and receiver.returncode == 0
