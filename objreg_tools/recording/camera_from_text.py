# SPDX-License-Identifier: Apache-2.0
"""A recording with the camera that its user gives, in place of every camera_info that it holds.

So the graph, a replay of it and the pages about it take the camera as they take any camera_info.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import chain
from typing import Any

from rosbags.interfaces import Qos

from objreg_ros.bridge.camera.calibration import Calibration, fitted, read_camera
from objreg_tools.recording.inputs import CAMERA_INFO, choose_inputs
from objreg_tools.recording.mounts import first_frames
from objreg_tools.recording.record import Record, Recording, Topic
from objreg_tools.recording.rosbag import messages

GIVEN = "/given/camera_info"  # the topic that it comes by


class CameraFromText(Recording):
    """The recording ``of``, with one camera_info on `GIVEN` before everything else, which late subscribers get too."""

    def __init__(self, of: Recording, camera: Calibration, frame_id: str, notes: Sequence[str] = ()) -> None:
        self._of, self._camera, self._frame_id = of, camera, frame_id
        self.path, self.kind, self.of_pictures, self.made_of = of.path, of.kind, of.of_pictures, of.made_of
        others = sorted(of.topics.keys() - _without_cameras(of).keys())
        self.notes = [*of.notes, *notes, *([f"not used, as a camera is given: {', '.join(others)}"] if others else [])]
        self.start_ns, self.end_ns = of.start_ns, of.end_ns
        self.topics = {**_without_cameras(of), GIVEN: Topic(GIVEN, CAMERA_INFO, 1)}

    def records(
        self, topics: Collection[str] | None = None, start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[Record]:
        """See `Recording.records`."""
        wanted = set(self.topics if topics is None else topics)
        within = (start_ns is None or start_ns <= self.start_ns) and (end_ns is None or end_ns > self.start_ns)
        camera = [Record.made(GIVEN, CAMERA_INFO, self.start_ns, self._message)] if within and GIVEN in wanted else []
        others = (wanted & self.topics.keys()) - {GIVEN}
        return chain(camera, self._of.records(others, start_ns, end_ns) if others else ())

    def obstacles(self, shipped_only: bool = True) -> dict[str, str]:
        """See `Recording.obstacles`; the camera has none."""
        return {name: why for name, why in self._of.obstacles(shipped_only).items() if name in self.topics}

    def offered_qos(self) -> dict[str, list[Qos]]:
        """See `Recording.offered_qos`."""
        return {name: offers for name, offers in self._of.offered_qos().items() if name in self.topics}

    @property
    def latched(self) -> dict[str, int]:
        """See `Recording.latched`; the camera is."""
        return {**{name: depth for name, depth in self._of.latched.items() if name in self.topics}, GIVEN: 1}

    def _message(self) -> Any:
        return messages.camera_info_from_text(self._camera, self.start_ns, self._frame_id)

    def close(self) -> None:
        """Let go of the files."""
        self._of.close()


def with_camera(
    recording: Recording, camera_text: str, remaps: Mapping[str, str] | None = None, source: str = "auto"
) -> Recording:
    """The recording with the camera that ``camera_text`` names, see `read_camera`; as it is where that is empty.

    ``remaps`` and ``source`` say which pictures the camera is of, as to `choose_inputs`. ValueError for what is no
    camera, and for one of pictures of another shape.
    """
    if not camera_text:
        return recording
    camera, notes = read_camera(camera_text)
    asked = {name: topic for name, topic in (remaps or {}).items() if name != "camera_info"}
    topics = {**_without_cameras(recording), GIVEN: Topic(GIVEN, CAMERA_INFO, 1)}
    inputs = choose_inputs(topics, asked, source, first_frames(recording))
    picture = inputs.depth or inputs.points or inputs.image
    read = (record.read() for record in recording.records([picture])) if picture else iter(())
    first = next((message for message in read if message is not None), None)
    if first is None:
        return CameraFromText(recording, camera, "", notes)
    try:
        return CameraFromText(recording, fitted(camera, first), str(first.header.frame_id), notes)
    except ValueError as error:
        raise ValueError(f"{recording.path}: {picture}: {error}") from error


def _without_cameras(recording: Recording) -> dict[str, Topic]:
    return {name: topic for name, topic in recording.topics.items() if topic.msgtype != CAMERA_INFO}
