# SPDX-License-Identifier: Apache-2.0
"""Someone has a bag of a RealSense as its driver names topics, and no odometry: look, run, page, a pair."""

from __future__ import annotations

import json
from pathlib import Path

from .folders import bag_of
from .trying import body
from .walk import Walk

CAMERA = "/camera/camera"
DRIVER = {
    "/image": f"{CAMERA}/color/image_raw",
    "/depth/image": f"{CAMERA}/aligned_depth_to_color/image_raw",
    "/camera_info": f"{CAMERA}/aligned_depth_to_color/camera_info",
}
SECONDS = 25.0  # the camera comes back by then


def walk(folder: Path, room: Path) -> None:
    """No topic has to be named; the camera is tracked, and the page says so."""
    bag_of(room, folder / "realsense", without={"/odom"}, names=DRIVER, seconds=SECONDS)
    someone = Walk(folder)
    seen = someone.type("inspect", "realsense")
    assert all(topic in seen.text for topic in DRIVER.values()) and "no odometry" in seen.text
    assert seen.command() == ["offline", "realsense", "--json", "run.json"]

    run = someone.follow(seen)
    assert "the registrar's own tracking" in run.text
    made = json.loads((folder / "run.json").read_text())
    assert made["odometry"] == "tracked" and made["constraints"]
    shown = someone.follow(run)
    assert "wrote report.html" in shown.text and "There is no odometry" in body(folder / "report.html")

    tried = someone.type("try", "realsense", "--no-open")
    assert "none: the registrar tracks the camera itself" in tried.text
    assert "asked for" in someone.follow(tried).text
