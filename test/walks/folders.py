# SPDX-License-Identifier: Apache-2.0
"""What users have on their disks, made of a simulated room: a TUM folder, and bags with something odd."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from itertools import islice
from pathlib import Path

import cv2

from objreg_ros.bridge.messages import camera_from_msg, from_msg, headers
from objreg_tools.recording import Record, open_recording, write_rosbag2

ODD_COLOUR = "/people/mask_preview"
SPARE_DEPTH = "/spare/depth"
TOPICS = ("/image", "/depth/image", "/camera_info", "/odom")


def tum_of(room: Path, folder: Path, frames: int, depth_scale: float = 5000, stated_scale: float | None = None) -> Path:
    """The first frames of a room as a TUM folder with ground truth.

    ``depth_scale`` and ``stated_scale`` are steps in a metre; camera.yaml states the second where it is given.
    """
    for name in ("rgb", "depth"):
        (folder / name).mkdir(parents=True)
    with open_recording(room) as opened:
        for record in islice(opened.records(["/image"]), frames):
            bgr = from_msg.image(record.message).rgb[:, :, ::-1]
            cv2.imwrite(str(folder / f"rgb/{_seconds(record)}.png"), bgr)
        for record in islice(opened.records(["/depth/image"]), frames):
            steps = from_msg.depth(record.message) * depth_scale
            steps[~(steps > 0)] = 0
            cv2.imwrite(str(folder / f"depth/{_seconds(record)}.png"), steps.round().astype("uint16"))
        _write_truth(folder / "groundtruth.txt", opened.records(["/ground_truth"]))
        info = camera_from_msg.intrinsics(next(opened.records(["/camera_info"])).message)
    camera = {"fx": info.fx, "fy": info.fy, "cx": info.cx, "cy": info.cy, "depth_scale": stated_scale or depth_scale}
    (folder / "camera.yaml").write_text("".join(f"{name}: {value:g}\n" for name, value in camera.items()))
    return folder


def _write_truth(file: Path, records: Iterator[Record]) -> None:
    lines = ["# timestamp tx ty tz qx qy qz qw"]
    for record in records:
        p, q = record.message.pose.position, record.message.pose.orientation
        lines.append(f"{_seconds(record)} {p.x} {p.y} {p.z} {q.x} {q.y} {q.z} {q.w}")
    file.write_text("\n".join(lines))


def _seconds(record: Record) -> str:
    stamp_ns = headers.stamp_ns(record.message)
    return f"{stamp_ns // 10**9}.{stamp_ns % 10**9 // 1000:06d}"


def bag_of(
    room: Path,
    folder: Path,
    without: Collection[str] = (),
    names: Mapping[str, str] | None = None,
    garbage: Collection[str] = (),
    twice: Mapping[str, str] | None = None,
    seconds: float = 8.0,
) -> Path:
    """The beginning of a room as a rosbag2 with something odd.

    Topics that are left out, that have other ``names``, whose pictures are cut short (``garbage``), and that are there
    ``twice``, whole, under another name too.
    """
    names, twice = names or {}, twice or {}

    def odd_records() -> Iterator[Record]:
        with open_recording(room) as opened:
            end_ns = opened.start_ns + round(seconds * 1e9)
            for record in opened.records([topic for topic in TOPICS if topic not in without], end_ns=end_ns):
                if record.topic in twice:
                    yield Record.of(twice[record.topic], record.message, record.stamp_ns)
                message = record.message
                if record.topic in garbage:
                    message.data = message.data[: len(message.data) // 2]
                yield Record.of(names.get(record.topic, record.topic), message, record.stamp_ns)

    write_rosbag2(folder, odd_records())
    return folder
