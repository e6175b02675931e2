# SPDX-License-Identifier: Apache-2.0
"""Someone types `objreg try`: a page comes out, and where the stream is not what it states, its first lines name it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from objreg_tools.recording import Record, open_recording, write_rosbag2

from .walk import Walk

TOPICS = ("/image", "/depth/image", "/camera_info", "/odom", "/ground_truth", "/tf_static")
FOCAL, SCALE = 1.4, 1.3  # times what is true
FRAMES = "160"  # enough to measure each
MOVING = ("--scenario", "loop", "--seed", "1", "--frames", "360", "--size", "320x240")
Change = Callable[[Any], None]


def a_simulated_recording(folder: Path, room: Path) -> None:
    """Nothing is wrong with it; the next command shows the steps of a closure."""
    someone = Walk(folder)
    tried = someone.type("try", str(room), "--no-open")
    assert tried.output.startswith("assumed:") and "It worked: " in tried.text and "none of the " in tried.text
    text = body(folder / f"{room.name}.html")
    assert text.startswith(room.name) and "What was assumed" in text and "All pairs" in text
    steps = someone.follow(tried, "--page", "pair.html")
    assert "asked for" in steps.text and "off by" in steps.text
    assert "one pair" in body(folder / "pair.html")


def wrong_focal_length(folder: Path, room: Path) -> None:
    """A camera_info of another picture."""

    def change(message: Any) -> None:
        k, p = np.array(message.k), np.array(message.p)
        k[[0, 4]] *= FOCAL
        p[[0, 5]] *= FOCAL
        message.k, message.p = k, p

    _tries(folder, room, {"/camera_info": change}, "camera-focal-length", "times the focal length")


def wrong_depth_scale(folder: Path, room: Path) -> None:
    """Depth in steps of another length than odometry says."""

    def change(message: Any) -> None:
        kind = {"16UC1": "<u2", "32FC1": "<f4"}[message.encoding]
        depth = message.data.view(kind)
        message.data = (depth * SCALE).astype(kind).view("u1")

    _tries(folder, room, {"/depth/image": change}, "depth-scale", "as far by its depth as by odometry")


def odometry_of_another_robot(folder: Path, room: Path) -> None:
    """The odometry of one that went the same path backwards."""
    with open_recording(room) as opened:
        poses = [record.message.pose.pose for record in opened.records(["/odom"])]

    def change(message: Any) -> None:
        message.pose.pose = poses.pop()

    _tries(folder, room, {"/odom": change}, "odometry-of-another-robot", "odometry turns")


def _tries(folder: Path, room: Path, changes: dict[str, Change], anchor: str, words: str) -> None:
    """The first lines of the terminal and of the page have the words, and lead to the section that says more."""
    write_rosbag2(folder / "bag", _changed(room, changes))
    tried = Walk(folder).type("try", "bag", "--no-open", "--max-frames", FRAMES)
    first = tried.output.splitlines()[0]
    assert first.startswith("! ") and words in first, tried.text
    assert anchor in tried.leads_to() and tried.advice()
    finding = body(folder / "bag.html").splitlines()
    assert finding[0] == "bag" and words in finding[1], finding[:5]


def _changed(room: Path, changes: dict[str, Change]) -> Iterator[Record]:
    with open_recording(room) as opened:
        for record in opened.records([topic for topic in TOPICS if topic in opened.topics]):
            message = record.message
            changes.get(record.topic, lambda message: None)(message)
            yield Record.of(record.topic, message, record.stamp_ns)


def body(page: Path) -> str:
    """The text of a page as it is read, line by line."""
    text = page.read_text(encoding="utf-8").partition("<main>")[2]
    lines = (line.strip() for line in re.sub(r"<[^>]*>", "\n", text).splitlines())
    return "\n".join(line for line in lines if line)
