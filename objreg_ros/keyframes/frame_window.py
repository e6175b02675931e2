# SPDX-License-Identifier: Apache-2.0
"""What passes between tracking and the search: the frames of one time, or the keyframe that another machine made."""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import Frame
from objreg_ros.keyframes.gravity_filter import GravityFilter
from objreg_ros.registration.keyframe import Keyframe


class SessionNumbers:
    """Gives sessions their numbers, from ``next`` on. For several threads."""

    def __init__(self, first: int = 0) -> None:
        self.next, self._lock = first, threading.Lock()

    def next_number(self) -> int:
        """A number that nothing has yet."""
        with self._lock:
            number, self.next = self.next, self.next + 1
        return number


class Clock(NamedTuple):
    """A run of the clock: time has only grown since ``began_ns``, and ``session`` was the first in it.

    It ends where time goes back: a looped bag, a simulation that begins anew, another start of the node.
    """

    began_ns: int
    session: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrameWindow:
    """Frames that are close in time: ``T_first_frame`` maps the camera of each frame into that of the first.

    ``T_session_first`` is the pose of the first camera in the frame of its session: the odometry's, or our own
    tracking's where odometry had a gap or there is none; ``by_odometry`` says which. ``session`` counts and changes
    where the track was lost; ``clock`` is the run of the clock that it is in. By then the camera had gone ``travelled``
    m in it and turned ``turned`` degrees.
    """

    frames: tuple[Frame, ...]
    T_first_frame: tuple[Array, ...]
    T_session_first: Array
    session: int
    clock: Clock = Clock(0, 0)
    by_odometry: bool = False
    travelled: float = 0.0
    turned: float = 0.0

    @property
    def nbytes(self) -> int:
        """The memory of its frames: their views and clouds."""
        return sum(map(_nbytes, self.frames))

    @property
    def robot(self) -> str:
        """Whose camera it is of."""
        return self.frames[0].robot

    @property
    def camera(self) -> tuple[str, str]:
        """Whose camera it is of, and its frame."""
        return self.robot, self.frames[0].frame_id

    @property
    def doubt(self) -> str:
        """Why its camera is not what it says; empty where there is no doubt."""
        return next((frame.doubt for frame in self.frames if frame.doubt), "")

    @property
    def proven(self) -> bool:
        """Whether enough of the stream was seen to believe its camera."""
        return self.frames[-1].proven

    @classmethod
    def of(cls, frame: Frame) -> FrameWindow:
        """One frame by itself."""
        return cls(frames=(alone(frame),), T_first_frame=(np.eye(4),), T_session_first=np.eye(4), session=0)


def _nbytes(frame: Frame) -> int:
    clouds = frame.objects if frame.support is None else (*frame.objects, frame.support)
    pixels = [frame.view.xyz, frame.view.grey]
    return sum(cloud.nbytes for cloud in clouds) + sum(array.nbytes for array in pixels if array is not None)


def alone(frame: Frame) -> Frame:
    """The frame with the weight that gravity has which no other view confirms."""
    return with_gravity_of(GravityFilter(1.0, 1.0), np.eye(4), frame)


def with_gravity_of(gravity_filter: GravityFilter, T_session_frame: Array, frame: Frame) -> Frame:
    """The frame with the gravity of a filter that knows of the frame too."""
    gravity, weight = gravity_filter.update(T_session_frame, frame.gravity, frame.gravity_confidence)
    return replace(frame, gravity=gravity, gravity_confidence=weight)


class Arrival(NamedTuple):
    """A keyframe that a keyframer elsewhere has made: its session and clock are as that one numbers them.

    ``run`` names one start of that keyframer, and no other of any.
    """

    keyframe: Keyframe
    clock: Clock
    run: str
