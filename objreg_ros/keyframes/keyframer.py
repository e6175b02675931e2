# SPDX-License-Identifier: Apache-2.0
"""From a stream of frames to frame windows: the few frames, close in time, that become one keyframe.

This is the part that runs on every frame, so it only tracks and collects; `fusion` makes a keyframe of a frame window.
A frame window ends when the camera has moved or enough time has passed, and is dropped when it shows nothing new: a
camera that rests makes one keyframe, not one a second. One that has all its frames is handed over before its end.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import JUMP_NS, UNNAMED, Frame
from objreg_ros.geometry import inverse, leaps, rigid, rotation_angle
from objreg_ros.keyframes.frame_window import Clock, FrameWindow, SessionNumbers, alone, with_gravity_of
from objreg_ros.keyframes.gravity_filter import GravityFilter
from objreg_ros.keyframes.odometry import TravelledPath
from objreg_ros.keyframes.own_size import sized_frame
from objreg_ros.keyframes.params import KeyframeParams
from objreg_ros.keyframes.tracking import SAME_PICTURE, TrackedSurface, same_picture, tracked_surface, view_motion
from objreg_ros.keyframes.turn import LastPicture

MOST_FRAMES = 4  # that are fused into one keyframe
LEAST_OBJECTS = 1  # of a keyframe: one without objects proposes nothing
GRAVITY_PATH_M = 2.0  # path after which gravity carried by odometry counts half
GRAVITY_TURN_DEG = 120.0  # turn after which gravity carried by odometry counts half
SURELY_SAME = 0.95  # correlation from which no other guess is tried
SILENCE_S = 5.0  # odometry may have begun anew in it without a leap
UNSET_NS = 0  # the stamp of a camera that starts before the simulated clock does: no clock began then


@dataclass(slots=True, eq=False)
class _Session:
    """A run of frames whose poses are known in one frame: the odometry's, or that of our own tracking."""

    number: int
    clock: Clock
    in_odometry: bool
    path: TravelledPath
    gravity_filter: GravityFilter
    first: Frame  # of the last frame window
    last_ns: int  # of the last frame that was followed
    T_odom_first: Array  # of its first camera, where there is odometry
    odometry: tuple[int, Array] | None = None  # the last that it had: stamp in ns, T_odom_camera

    def leaps(self, frame: Frame, max_speed: float) -> bool:
        """Whether odometry has begun anew: no camera moves so fast."""
        if self.odometry is None or frame.T_odom_camera is None:
            return False
        last_ns, T_odom_last = self.odometry
        return leaps(T_odom_last, frame.T_odom_camera, 1e-9 * (frame.stamp_ns - last_ns), max_speed, self.T_odom_first)

    def silent_s(self, frame: Frame) -> float:
        """For how many seconds there was no frame before this one."""
        return 1e-9 * (frame.stamp_ns - self.last_ns)

    def lose(self, seconds: float, max_speed: float) -> None:
        """After a long silence neither the path so far nor the direction of gravity is known."""
        self.path.lose(seconds, max_speed)
        self.gravity_filter.reset()

    def follow_frame(self, frame: Frame) -> None:
        """Go on to a frame."""
        self.last_ns = frame.stamp_ns
        if frame.T_odom_camera is not None:
            self.odometry = frame.stamp_ns, frame.T_odom_camera

    def goes_on(self, frame: Frame) -> bool:
        """Whether a later frame may belong to it: of the same camera, and with odometry only if the session has it."""
        return frame.frame_id == self.first.frame_id and (self.in_odometry or frame.T_odom_camera is None)


def _with_session_gravity(session: _Session, frame: Frame) -> Frame:
    """The frame with the gravity of all views of the session, or its own where odometry does not carry that.

    Our own tracking slips unnoticed, and what it carries then is wrong.
    """
    return (
        alone(frame)
        if frame.T_odom_camera is None
        else with_gravity_of(session.gravity_filter, frame.T_odom_camera, frame)
    )


@dataclass(slots=True, eq=False)
class _Open:
    """The frame window that is being collected."""

    session: _Session
    first: Frame
    surface: TrackedSurface
    T_session_first: Array
    frames: list[Frame] = field(default_factory=list)
    motions: list[Array] = field(default_factory=list)
    T_first_last: Array = field(default_factory=lambda: np.eye(4))
    is_handed_over: bool = False

    @property
    def by_odometry(self) -> bool:
        return self.first.T_odom_camera is not None


class Keyframer:
    """Collects frames into frame windows. ``add_frame`` returns the one that a frame ended or made full, or None.

    ``numbers`` gives each session its number; keyframers that share it have none in common.
    """

    def __init__(self, params: KeyframeParams, numbers: SessionNumbers | None = None) -> None:
        self.params = params
        self._numbers = SessionNumbers() if numbers is None else numbers
        self._clock: Clock | None = None
        self._last_ns: int | None = None  # of the last frame
        self._open: _Open | None = None
        self._session: _Session | None = None
        self._last_picture = LastPicture()
        self._last: tuple[int, Array, Counter[str]] | None = None  # session, pose and labels of the last frame window

    @property
    def session(self) -> int:
        """The number of the session that goes on; -1 before the first frame."""
        return -1 if self._session is None else self._session.number

    @property
    def tracked(self) -> tuple[int, Array] | None:
        """The session of the newest frame that was followed, and ``T_session_camera`` of it; None if none is."""
        window = self._open
        return None if window is None else (window.session.number, window.T_session_first @ window.T_first_last)

    def add_frame(self, frame: Frame) -> FrameWindow | None:
        """Track the frame and collect it. A lost track, odometry that leaps or a clock that does begins a new session.
        One that is not later than the last, but by no jump, is passed over.
        """
        frame = sized_frame(frame)
        last_ns, session = self._last_ns, self._session
        if last_ns is not None and 0 <= last_ns - frame.stamp_ns < JUMP_NS:
            return None
        self._last_ns = frame.stamp_ns
        if last_ns is None or frame.stamp_ns < last_ns or (last_ns == UNSET_NS and frame.stamp_ns > JUMP_NS):
            self._clock = None
            return self._start(frame)
        if session is None or not session.goes_on(frame) or session.leaps(frame, self.params.max_speed):
            return self._start(frame)
        T_session_frame = self._follow(frame)
        if T_session_frame is None:
            return None if self._may_come_back(session, frame) else self._start(frame)
        silent_s = session.silent_s(frame)
        ended = self._end() if silent_s > SILENCE_S or self._is_over(frame, T_session_frame) else None
        if silent_s > SILENCE_S:
            session.lose(silent_s, self.params.max_speed)
        session.follow_frame(frame)
        frame = _with_session_gravity(session, frame)
        if self._open is None:
            self._begin(session, frame, T_session_frame)
        else:
            self._collect(self._open, frame, inverse(self._open.T_session_first) @ T_session_frame)
        return ended or self._full_window(self._open)

    def finish_window(self) -> FrameWindow | None:
        """End the frame window that is being collected: None if there is none or it shows nothing new.

        The session goes on with the next frame where odometry says where that is; else it begins another.
        """
        return self._end()

    def _start(self, frame: Frame) -> FrameWindow | None:
        """End what is being collected, and start another session with this frame."""
        ended, number = self._end(), self._numbers.next_number()
        self._clock = self._clock or Clock(frame.stamp_ns, number)
        T_session_frame = np.eye(4) if frame.T_odom_camera is None else frame.T_odom_camera
        self._session = _Session(
            number=number,
            clock=self._clock,
            in_odometry=frame.T_odom_camera is not None,
            path=TravelledPath(T_session_frame),
            gravity_filter=GravityFilter(GRAVITY_PATH_M, GRAVITY_TURN_DEG),
            first=frame,
            last_ns=frame.stamp_ns,
            T_odom_first=T_session_frame,
        )
        self._session.follow_frame(frame)
        if not self._session.in_odometry:
            self._last_picture.set_first(frame.view)
        self._begin(self._session, _with_session_gravity(self._session, frame), T_session_frame)
        return ended

    def _begin(self, session: _Session, frame: Frame, T_session_frame: Array) -> None:
        """Begin a frame window with this frame. The path there counts whether or not it becomes a keyframe."""
        session.first = frame
        session.path.go(T_session_frame)
        self._open = _Open(session, frame, tracked_surface(frame.view), T_session_frame)
        self._collect(self._open, frame, np.eye(4))

    def _end(self) -> FrameWindow | None:
        window, self._open = self._open, None
        return None if window is None or window.is_handed_over else self._window_of(window)

    def _full_window(self, window: _Open | None) -> FrameWindow | None:
        """One that takes no more frames, once: it need not wait for its end, which changes nothing of it."""
        if window is None or window.is_handed_over or len(window.frames) < MOST_FRAMES:
            return None
        window.is_handed_over = True
        return self._window_of(window)

    def _window_of(self, window: _Open) -> FrameWindow | None:
        """What was collected; None where it shows nothing new."""
        if not window.frames:
            return None
        labels: Counter[str] = Counter()
        for frame in window.frames:
            labels |= Counter(item.label for item in frame.objects if len(item))
        empty = labels.total() < LEAST_OBJECTS
        del labels[UNNAMED]  # one more of these is no news: they come and go with the noise
        if empty or not self._is_news(window, labels):
            return None
        self._last = (window.session.number, window.T_session_first, labels)
        return FrameWindow(
            frames=tuple(window.frames),
            T_first_frame=tuple(window.motions),
            T_session_first=window.T_session_first,
            session=window.session.number,
            clock=window.session.clock,
            by_odometry=window.by_odometry,
            travelled=window.session.path.travelled,
            turned=window.session.path.turned,
        )

    def _follow(self, frame: Frame) -> Array | None:
        """The pose of a frame in its session, in a gap of the odometry by the views; None if the track is lost."""
        if frame.T_odom_camera is not None or self._open is None:
            return frame.T_odom_camera
        T_first_frame = self._by_views(self._open, frame)
        return None if T_first_frame is None else rigid(self._open.T_session_first @ T_first_frame)

    def _by_views(self, window: _Open, frame: Frame) -> Array | None:
        """``T_first_frame`` by the views; None if the track is lost.

        They are aligned from where the last one was and from how the camera turned since, the latter first where it
        turned fast. A pose counts only where both views show the same picture.
        """
        view, surface = frame.view, window.surface
        if window.session.in_odometry:
            return view_motion(view, surface, window.T_first_last)
        turn, guesses = self._last_picture.next(view), [window.T_first_last]
        if turn.T_last_frame is not None:
            guesses.insert(0 if turn.is_fast else 1, window.T_first_last @ turn.T_last_frame)
        found, best = None, SAME_PICTURE
        for guess in guesses:
            T_first_frame = view_motion(view, surface, guess)
            if T_first_frame is not None and (same := same_picture(view, surface, T_first_frame)) >= best:
                found, best = T_first_frame, same
            if best >= SURELY_SAME:
                break
        return found

    def _may_come_back(self, session: _Session, frame: Frame) -> bool:
        """Whether odometry is only a little late: such a frame is passed over."""
        return session.in_odometry and 1e-9 * (frame.stamp_ns - session.last_ns) < self.params.keyframe_seconds

    def _collect(self, window: _Open, frame: Frame, T_first_frame: Array) -> None:
        window.T_first_last = T_first_frame
        if not frame.objects or len(window.frames) >= MOST_FRAMES:
            return
        if not window.frames or self._moved(inverse(window.motions[-1]) @ T_first_frame, 1.0 / MOST_FRAMES):
            window.frames.append(frame)
            window.motions.append(T_first_frame)

    def _is_over(self, frame: Frame, T_session_frame: Array) -> bool:
        """Whether the frame is of another time, or odometry is back: it gives no motion from a pose of our own."""
        window = self._open
        if window is None:
            return False
        back = frame.T_odom_camera is not None and window.session.in_odometry and not window.by_odometry
        moved = self._moved(inverse(window.T_session_first) @ T_session_frame, 1.0)
        return back or moved or 1e-9 * (frame.stamp_ns - window.first.stamp_ns) > self.params.keyframe_seconds

    def _is_news(self, window: _Open, labels: Counter[str]) -> bool:
        if self._last is None or self._last[0] != window.session.number:
            return True
        _, T_session_last, known = self._last
        return bool(labels - known) or self._moved(inverse(T_session_last) @ window.T_session_first, 0.5)

    def _moved(self, T: Array, share: float) -> bool:
        """Whether a motion exceeds ``share`` of what ends a keyframe."""
        metres, degrees = float(np.linalg.norm(T[:3, 3])), float(np.degrees(rotation_angle(T[:3, :3])))
        return metres > share * self.params.keyframe_translation or degrees > share * self.params.keyframe_rotation
