# SPDX-License-Identifier: Apache-2.0
"""One camera with the odometry beside it: which of it is used, where the camera sits, and what does not fit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from objreg_ros.bridge.camera.mount import Mount, Seat
from objreg_ros.bridge.messages import from_msg
from objreg_ros.data.checked import Array
from objreg_ros.data.frames import Frame, Odometry
from objreg_ros.plausibility.finding import Finding
from objreg_ros.plausibility.findings import pasted
from objreg_ros.plausibility.stream_monitor import StreamMonitor


class CameraStream:
    """Gives frames their pose by odometry, and the doubt about their camera.

    Odometry of another robot is not used, nor is one whose body is not known to carry the camera until the mount is
    measured. ``say`` is given each assumption, once.
    """

    def __init__(self, mount: Mount, say: Callable[[str], None] = lambda text: None) -> None:
        self._mount, self._say = mount, say
        self._monitor = StreamMonitor()
        self._newest: Odometry | None = None
        self._measured = False
        self.without_odometry = 0  # frames
        self.T_body_camera: Array | None = None  # of the last frame; None where it is the body, or unknown

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What was found so far."""
        return self._monitor.findings

    @property
    def mount(self) -> Array | None:
        """The measured ``T_body_camera (4, 4)``; None where something says it, or where it is not known well yet."""
        return self._monitor.T_body_camera if self._measured else None

    def take_odometry(self, sample: Odometry) -> None:
        """A sample of odometry, whether or not a frame comes by it."""
        self._newest = sample
        self._monitor.take_odometry(sample)

    def place(self, frame: Frame, odometry: Sequence[Odometry] | None) -> Frame:
        """The frame with the odometry around it, if that is this camera's, and with the doubt there is."""
        seat, T_body_camera = self._known_mount(frame, odometry)
        known = np.eye(4) if seat is Seat.ONE_PLACE else T_body_camera
        self._monitor.follow_view(frame.stamp_ns, frame.view, frame.frame_id, known, has_odometry=bool(odometry))
        if seat is Seat.UNKNOWN:
            T_body_camera = self._measured_mount()
        unusable = seat is Seat.BEYOND or (seat is Seat.UNKNOWN and T_body_camera is None) or self._monitor.disowned
        used = None if unusable else odometry
        self.without_odometry += not used
        self.T_body_camera = T_body_camera
        placed = from_msg.followed(frame, used, T_body_camera)
        return replace(placed, doubt=self._monitor.doubt, proven=self._monitor.proven)

    def judge_rest(self) -> str:
        """Look at what has come by the end of a recording; the doubt there is of the camera, "" for none."""
        self._monitor.judge_rest()
        return self._monitor.doubt

    def _known_mount(self, frame: Frame, odometry: Sequence[Odometry] | None) -> tuple[Seat, Array | None]:
        """What is said of the mount; of frames without odometry by the newest sample."""
        asked = odometry or ((self._newest,) if self._newest is not None else None)
        return self._mount.seated(asked, frame.frame_id, frame.stamp_ns) if asked else (Seat.UNKNOWN, None)

    def _measured_mount(self) -> Array | None:
        T_body_camera = self._monitor.T_body_camera
        if T_body_camera is not None and not self._measured:
            self._measured = True
            self._say(f"the mount was measured from the motion: T_base_camera: {pasted(T_body_camera)}")
        return T_body_camera
