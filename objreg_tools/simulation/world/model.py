# SPDX-License-Identifier: Apache-2.0
"""One instance of an object class: its mesh, its symmetry, and how it comes to rest on a surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse, pose, pose_error, rotation_between, rotation_from_vector, transform
from objreg_tools.simulation.world.mesh import Mesh


def turn(axis: str, degrees: float) -> Array:
    """The (4, 4) rotation about x, y or z by an angle in degrees."""
    vector = np.radians(degrees) * np.eye(3)["xyz".index(axis)]
    return pose(rotation_from_vector(vector), np.zeros(3))


@dataclass(frozen=True, eq=False)
class Symmetry:
    """Motions of the object frame that leave an object's shape as it is; print and colour are not looked at.

    ``axis (3,)`` through ``centre (3,)`` is an axis of revolution or None; ``turns (S, 4, 4)`` are the discrete
    motions, the identity among them, that a shape without axis has.
    """

    axis: Array | None = None
    centre: Array | None = None
    turns: Array | None = None

    def pose_error(self, T_estimated: Array, T_true: Array) -> tuple[float, float]:
        """(degrees, centimetres) between two poses of the object, by the symmetric motion that makes it least.

        The distance is that of the object's centre. Both poses are (4, 4) of the object in one and the same frame.
        """
        candidates = [T_true @ motion for motion in (self.turns if self.turns is not None else np.eye(4)[None])]
        if self.axis is not None:
            candidates = [self._aligned(T_estimated, T_true)]
        at_centre = np.eye(4)
        at_centre[:3, 3] = 0 if self.centre is None else self.centre
        return min(pose_error(T_estimated @ at_centre, T @ at_centre) for T in candidates)

    def _aligned(self, T_estimated: Array, T_true: Array) -> Array:
        """The true pose turned about the axis of revolution as near to the estimate as it gets."""
        assert self.axis is not None
        swing = rotation_between(T_true[:3, :3] @ self.axis, T_estimated[:3, :3] @ self.axis)
        R = swing.T @ T_estimated[:3, :3]
        centre = np.zeros(3) if self.centre is None else self.centre
        return pose(R, transform(T_true, centre) - R @ centre)


def revolution(axis: str, centre: Array) -> Symmetry:
    """The symmetry of a body of revolution about x, y or z through ``centre``."""
    return Symmetry(axis=np.eye(3)["xyz".index(axis)], centre=np.asarray(centre, float))


def half_turns(centre: Array) -> Symmetry:
    """The symmetry of a box with three different sides: half a turn about each axis through ``centre``."""
    shift = pose(np.eye(3), np.asarray(centre, float))
    turns = [np.eye(4)] + [shift @ turn(axis, 180.0) @ inverse(shift) for axis in "xyz"]
    return Symmetry(centre=np.asarray(centre, float), turns=np.stack(turns))


@dataclass(frozen=True, eq=False)
class ObjectModel:
    """One instance: ``label``; ``mesh`` in the object frame, standing on z = 0 with z up; ``symmetry`` of its shape.

    ``rests`` are rotations (4, 4) into other poses in which it comes to rest; ``on_floor`` says that it stands on the
    floor and not on a table.
    """

    label: str
    mesh: Mesh
    symmetry: Symmetry
    rests: tuple[Array, ...] = ()
    on_floor: bool = False

    @property
    def size(self) -> Array:
        """(3,) extent in metres along x, y and z of the object frame."""
        low, high = self.mesh.bounds
        return (high - low).astype(float)

    @property
    def radius(self) -> float:
        """Half the diagonal of the footprint in metres, from the z axis."""
        return float(np.linalg.norm(self.mesh.vertices[:, :2], axis=1).max())

    def resting(self, choice: int, yaw: float) -> Array:
        """``T_surface_object``: the object at rest on z = 0, standing for 0 or in its ``choice``-th other pose."""
        R = np.eye(4) if choice == 0 else self.rests[choice - 1]
        turned = transform(R, self.mesh.vertices.astype(float))
        low, high = turned.min(0), turned.max(0)
        T = turn("z", np.degrees(yaw)) @ pose(np.eye(3), np.array([*(-(low + high) / 2)[:2], -low[2]])) @ R
        return turn("z", np.degrees(yaw)) if choice == 0 else T
