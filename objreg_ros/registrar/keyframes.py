# SPDX-License-Identifier: Apache-2.0
"""From a stream of frames to stretches: the few frames, close in time, that become one keyframe.

This is the part that runs on every frame, so it only tracks and collects; `fusion` makes a keyframe of a stretch. A
stretch ends when the camera has moved or enough time has passed, and is dropped when it shows nothing new: a camera
that rests makes one keyframe, not one a second.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from objreg_ros.data import Array, Frame
from objreg_ros.geometry import inverse, rotation_angle
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.tracking import Surface, surface_of, view_motion


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stretch:
    """Frames of one moment: ``T_first_frame`` maps the camera of each frame into that of the first.

    ``T_session_first`` is the pose of the first camera in the frame of its session: the odometry's, or our own
    tracking's where there is no odometry; ``session`` counts from 0 and changes where the track was lost.
    """

    frames: tuple[Frame, ...]
    T_first_frame: tuple[Array, ...]
    T_session_first: Array
    session: int
    by_odometry: bool = False


@dataclass(slots=True, eq=False)
class _Open:
    """The stretch that is being collected."""

    first: Frame
    surface: Surface
    T_session_first: Array
    by_odometry: bool
    frames: list[Frame] = field(default_factory=list)
    motions: list[Array] = field(default_factory=list)
    T_first_last: Array = field(default_factory=lambda: np.eye(4))


class Keyframer:
    """Collects frames into stretches. ``add`` returns the stretch that a frame ended, or None."""

    def __init__(self, params: RegistrarParams) -> None:
        self._params = params
        self._open: _Open | None = None
        self._session = 0
        self._last: tuple[int, Array, Counter[str]] | None = None  # session, pose and labels of the last stretch

    def add(self, frame: Frame) -> Stretch | None:
        """Track the frame and collect it. A lost track or a jump back in time begins a new session."""
        if self._open is None:
            self._begin(frame)
            return None
        T_first_frame = self._motion(self._open, frame)
        if T_first_frame is None:
            ended = self.finish()
            self._begin(frame)
            return ended
        if not self._ends(self._open, frame, T_first_frame):
            self._collect(self._open, frame, T_first_frame)
            return None
        T_session_frame, by_odometry = self._open.T_session_first @ T_first_frame, self._open.by_odometry
        ended = self._end()
        self._begin(frame, T_session_frame, by_odometry)
        return ended

    def finish(self) -> Stretch | None:
        """End the stretch that is being collected, and the session: None if there is none or it shows nothing new."""
        ended = self._end()
        self._session += 1
        return ended

    def _end(self) -> Stretch | None:
        stretch, self._open = self._open, None
        if stretch is None or not stretch.frames:
            return None
        labels: Counter[str] = Counter()
        for frame in stretch.frames:
            labels |= Counter(item.label for item in frame.objects)
        if labels.total() < self._params.keyframe_min_objects or not self._is_news(stretch, labels):
            return None
        self._last = (self._session, stretch.T_session_first, labels)
        return Stretch(
            frames=tuple(stretch.frames),
            T_first_frame=tuple(stretch.motions),
            T_session_first=stretch.T_session_first,
            session=self._session,
            by_odometry=stretch.by_odometry,
        )

    def _begin(self, frame: Frame, T_session_frame: Array | None = None, by_odometry: bool = False) -> None:
        """Start a stretch with this frame; without a pose it is the first of a session."""
        if frame.T_odom_camera is not None:
            T_session_frame, by_odometry = frame.T_odom_camera, True
        T = np.eye(4) if T_session_frame is None else T_session_frame
        self._open = _Open(frame, surface_of(frame.view), T, by_odometry)
        self._collect(self._open, frame, np.eye(4))

    def _motion(self, stretch: _Open, frame: Frame) -> Array | None:
        if frame.stamp_ns <= stretch.first.stamp_ns or frame.frame_id != stretch.first.frame_id:
            return None
        if frame.T_odom_camera is None:  # a gap in the odometry is bridged by the views
            return view_motion(frame.view, stretch.surface, stretch.T_first_last)
        if not stretch.by_odometry:  # odometry begins: its frame is not the one that we tracked in
            return None
        return inverse(stretch.T_session_first) @ frame.T_odom_camera

    def _collect(self, stretch: _Open, frame: Frame, T_first_frame: Array) -> None:
        stretch.T_first_last = T_first_frame
        if not frame.objects or len(stretch.frames) >= self._params.keyframe_frames:
            return
        share = 1.0 / self._params.keyframe_frames
        if not stretch.frames or self._moved(inverse(stretch.motions[-1]) @ T_first_frame, share):
            stretch.frames.append(frame)
            stretch.motions.append(T_first_frame)

    def _ends(self, stretch: _Open, frame: Frame, T_first_frame: Array) -> bool:
        lasted = 1e-9 * (frame.stamp_ns - stretch.first.stamp_ns)
        return lasted > self._params.keyframe_seconds or self._moved(T_first_frame, 1.0)

    def _is_news(self, stretch: _Open, labels: Counter[str]) -> bool:
        if self._last is None or self._last[0] != self._session:
            return True
        _, T_session_last, known = self._last
        return bool(labels - known) or self._moved(inverse(T_session_last) @ stretch.T_session_first, 0.5)

    def _moved(self, T: Array, share: float) -> bool:
        """Whether a motion exceeds ``share`` of what ends a keyframe."""
        turned = np.degrees(rotation_angle(T[:3, :3]))
        params = self._params
        return bool(
            np.linalg.norm(T[:3, 3]) > share * params.keyframe_translation or turned > share * params.keyframe_rotation
        )
