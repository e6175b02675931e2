# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import numpy as np
from recording.sample_folders import CAMERA, records

from objreg_ros.data.images import Intrinsics
from objreg_tools.recording import Recording, open_recording, write_rosbag2
from objreg_tools.recording.inputs import choose_inputs
from objreg_tools.recording.record import Record
from objreg_tools.recording.rosbag import messages
from objreg_tools.rehearsal import rehearse
from objreg_tools.report.run.findings import found_in

PERIOD_NS = 33_000_000


def rehearsed(recording: Recording, frames: int = 400) -> tuple[int, dict[str, int], list[str]]:
    """How many frames came through, what was dropped, and the anchors of what was found."""
    run = rehearse(recording, choose_inputs(recording.topics), frames)
    return run.frames, dict(run.dropped), [finding.anchor for finding in found_in(run)]


def pictures(path: Path, camera: Intrinsics, count: int = 4) -> Recording:
    """Colour and depth of 48 × 64 with the camera_info of a camera."""
    made = []
    for ns in range(5, 5 + count * PERIOD_NS, PERIOD_NS):
        made += [
            Record.of("/camera_info", messages.camera_info(camera, ns, "c"), ns),
            Record.of("/image", messages.image(np.zeros((48, 64, 3), np.uint8), "rgb8", ns, "c"), ns),
            Record.of("/depth/image", messages.image(np.full((48, 64), 1000, np.uint16), "16UC1", ns, "c"), ns),
        ]
    write_rosbag2(path, made)
    return open_recording(path)


def test_every_frame_of_a_good_recording_comes_through(tmp_path: Path) -> None:
    write_rosbag2(tmp_path / "bag", records(frames=4))
    assert rehearsed(open_recording(tmp_path / "bag")) == (4, {}, [])


def test_only_the_beginning_is_looked_at(tmp_path: Path) -> None:
    frames, dropped, _ = rehearsed(pictures(tmp_path / "bag", CAMERA, count=6), frames=2)
    assert frames == 2 and dropped == {}


def test_what_would_drop_every_frame_is_found(tmp_path: Path) -> None:
    other_size = Intrinsics(fx=100.0, fy=100.0, cx=63.5, cy=47.5, width=128, height=96)
    frames, dropped, anchors = rehearsed(pictures(tmp_path / "bag", other_size))
    assert frames == 0 and sum(dropped.values()) >= 1 and anchors == ["no-frame-got-through"]


def test_a_camera_that_cannot_be_is_found_without_a_motion(tmp_path: Path) -> None:
    outside = Intrinsics(fx=60.0, fy=60.0, cx=90.0, cy=23.5, width=64, height=48)
    frames, _, anchors = rehearsed(pictures(tmp_path / "bag", outside))
    assert frames == 4 and anchors == ["camera-principal-point"]
