# SPDX-License-Identifier: Apache-2.0
"""Walls and boxes straight ahead, of which every depth is known."""

from __future__ import annotations

import numpy as np

from objreg_tools.simulation.params import DepthParams
from objreg_tools.simulation.rendering.light import looking
from objreg_tools.simulation.world.mesh import Material, box
from objreg_tools.simulation.world.model import ObjectModel, Symmetry
from objreg_tools.simulation.world.scene import Placed, Scene

PERFECT = DepthParams(
    noise_floor=0.0, noise_growth=0.0, quantum=0.0, baseline=0.0, dropout=0.0, edge_jitter=0.0,
    edge_dropout=0.0, mixed=0.0, grazing_cosine=0.0, near=0.0, far=50.0,
)  # fmt: skip
AHEAD = looking(np.zeros(3), np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]))
AMBIENT = np.full(3, 0.5)


def plain(grey: int) -> Material:
    return Material(np.full((4, 4, 3), grey, np.uint8))


def printed() -> Material:
    rng = np.random.default_rng(5)
    return Material(rng.integers(40, 220, (256, 256, 1)).repeat(3, axis=2).astype(np.uint8))


def wall(metres: float, material: Material) -> Scene:
    return Scene((), (box((40.0, 1.0, 40.0), material).moved(y=metres + 0.5, z=-20.0),), (), AMBIENT)


def box_before_wall(material: Material) -> Scene:
    """A box 0.4 m wide at 1 m before a wall at 2 m."""
    model = ObjectModel("book", box((0.4, 0.1, 0.4), material), Symmetry())
    T = np.eye(4)
    T[:3, 3] = [0.0, 1.05, -0.2]
    return wall(2.0, material).with_objects([Placed(1, model, T)])


def corner(material: Material) -> Scene:
    """Two walls that meet at a right angle 2 m ahead."""
    s = np.sqrt(0.5)
    meshes = []
    for side in (-1.0, 1.0):
        T = np.eye(4)
        T[:2, :2] = [[s, -side * s], [side * s, s]]
        out = T[:2, :2] @ np.array([0.0, 0.5])
        T[:3, 3] = [out[0], 2.0 + out[1], -5.0]
        meshes.append(box((10.0, 1.0, 10.0), material).placed(T))
    return Scene((), tuple(meshes), (), AMBIENT)
