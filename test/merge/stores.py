# SPDX-License-Identifier: Apache-2.0
"""Small stores of one simple place, which differ by when and from where it was seen."""

from __future__ import annotations

from pathlib import Path

from registration import rooms

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import Frame
from objreg_ros.geometry import inverse
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.registrar import Registrar

PARAMS = RegistrarParams()
HERE = rooms.look_at((0.2, 0.0, 1.3), (1.8, 0.0, 0.75))
BESIDE = rooms.look_at((0.35, 0.25, 1.25), (1.8, 0.0, 0.75))
ASIDE = rooms.look_at((0.3, -0.2, 1.3), (1.8, 0.0, 0.75))
AWAY = rooms.look_at((0.2, 0.0, 1.3), (2.8, -1.4, 1.0))


def frame(seconds: float, T_world_camera: Array, T_odom_world: Array, robot: str = "") -> Frame:
    """What a camera sees from there, with odometry that began elsewhere."""
    seen = rooms.keyframe(T_world_camera, seed=round(10 * seconds))
    return Frame(
        objects=tuple(item.cloud for item in seen.objects),
        support=None,
        view=seen.view,
        gravity=seen.gravity,
        gravity_confidence=1.0,
        T_odom_camera=T_odom_world @ T_world_camera,
        stamp_ns=round(1e9 * seconds),
        robot=robot,
    )


def store(path: Path, *moments: tuple[float, Array], robot: str = "") -> Path:
    """A registrar's store of a camera that was there at these times; its odometry begins where it is first."""
    T_odom_world = inverse(moments[0][1])
    registrar = Registrar(PARAMS.replaced(store=str(path)))
    for seconds, T_world_camera in moments:
        registrar.process(frame(seconds, T_world_camera, T_odom_world, robot))
    registrar.finish()
    registrar.close()
    return path


def two_stores(folder: Path, robots: tuple[str, str] = ("", "")) -> list[Path]:
    """One of two keyframes and one of two others, of the same place half a minute later."""
    return [
        store(folder / "east.db", (0, HERE), (1, AWAY), robot=robots[0]),
        store(folder / "west.db", (30, BESIDE), (32, ASIDE), robot=robots[1]),
    ]
