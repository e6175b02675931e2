# SPDX-License-Identifier: Apache-2.0
"""Two sessions of one place, made of one recording: what the earlier one knew, and the later one that begins anew."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import UNNAMED, Frame
from objreg_ros.geometry import inverse, transform
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.registrar import Registrar
from objreg_ros.registration.keyframe import bounding_box
from objreg_tools.truth import Truth

NEAR_M = 0.3  # an object that is known stands no farther from where it stood
LATER_NS = 10**15  # the later sessions' clock goes on long after the earlier one


@dataclass
class Earlier:
    """What the earlier session knew: where the world was in its odometry, moment by moment, and its objects in it."""

    stamps_ns: list[int]
    T_odom_world: list[Array]
    objects: list[tuple[str, Array]]

    @classmethod
    def of(cls, frames: Iterable[Frame], truth: Truth) -> Earlier:
        """Of the frames of the earlier session."""
        made = cls([], [], [])
        for frame in frames:
            T = truth.at(frame.stamp_ns)
            if T is not None and frame.T_odom_camera is not None:
                made.stamps_ns.append(frame.stamp_ns)
                made.T_odom_world.append(frame.T_odom_camera @ inverse(T))
                made.objects += objects_of(frame, T)
        return made

    def knows(self, frame: Frame, T_world_camera: Array) -> bool:
        """Whether a frame shows an object where it was before."""
        seen = objects_of(frame, T_world_camera)
        return self.known_among(seen) > 0

    def known_among(self, seen: Sequence[tuple[str, Array]]) -> int:
        """How many of these objects, each a label and a true middle (3,), stand where one of that label stood."""
        by_label = {name: np.array([at for label, at in self.objects if label == name]) for name, _ in seen}
        nearest = [
            np.linalg.norm(by_label[name].reshape(-1, 3) - xyz, axis=1).min(initial=np.inf) for name, xyz in seen
        ]
        return sum(bool(metres < NEAR_M) for metres in nearest)

    def T_map_camera(self, T_world_camera: Array, beside_ns: int) -> Array:
        """Where a true pose (4, 4) is in its map, by its odometry at a moment of its own."""
        return self.T_odom_world[int(np.argmin(np.abs(np.array(self.stamps_ns) - beside_ns)))] @ T_world_camera


def objects_of(frame: Frame, T_world_camera: Array) -> list[tuple[str, Array]]:
    """The label and the true middle (3,) of each object with a name."""
    named = [cloud for cloud in frame.objects if cloud.label != UNNAMED and len(cloud)]
    return [(cloud.label, transform(T_world_camera, bounding_box(cloud.xyz)[0])) for cloud in named]


def begun_anew(frames: Sequence[Frame]) -> list[Frame]:
    """The frames long after, in odometry that begins where the first camera stands, turned about its z axis only."""
    first = next(frame.T_odom_camera for frame in frames if frame.T_odom_camera is not None)
    yaw = np.arctan2(first[1, 2], first[0, 2])  # of the line of sight
    T = np.eye(4)
    T[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    T[:3, 3] = first[:3, 3]
    back = inverse(T)
    return [
        replace(
            frame,
            stamp_ns=frame.stamp_ns + LATER_NS,
            T_odom_camera=None if frame.T_odom_camera is None else back @ frame.T_odom_camera,
        )
        for frame in frames
    ]


def remember(store: Path, frames: Iterable[Frame], params: RegistrarParams) -> None:
    """Make the store of the earlier session, with its closures."""
    with closing(Registrar(params.replaced(store=str(store)))) as registrar:
        for frame in frames:
            registrar.process(frame)
        registrar.finish()
