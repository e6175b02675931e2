# SPDX-License-Identifier: Apache-2.0
"""An Azure Kinect: little noise, more of what is far or dark; flying pixels; corners too deep; dark things lost."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ndtr

from objreg_tools.simulation.params import TimeOfFlightParams
from objreg_tools.simulation.rendering.render import Rendering, render
from objreg_tools.simulation.sensors.camera import CAMERAS
from objreg_tools.simulation.world.scene import Scene
from simulation.walls import AHEAD, box_before_wall, corner, plain, wall

AZURE = CAMERAS["azure_kinect"]
MIDDLE = (slice(238, 338), slice(270, 370))
"""Seen nearly at a right angle."""
CLEAN = TimeOfFlightParams(multipath=0.0, dropout=0.0, least_signal=0.0)


def seen(scene: Scene, params: TimeOfFlightParams, seed: int = 0) -> Rendering:
    return render(scene, AHEAD, AZURE, seed, params, with_colour=False)


@pytest.mark.parametrize("metres", [1.0, 2.0, 3.0])
@pytest.mark.parametrize("grey", [230, 90])
def test_the_noise_grows_with_distance_and_with_darkness(metres: float, grey: int) -> None:
    error = seen(wall(metres, plain(grey)), CLEAN).depth[MIDDLE] - metres
    assert error.std() == pytest.approx(0.0005 * metres / np.sqrt((grey / 255) ** 2.2), rel=0.04)
    assert abs(error.mean()) < 0.05 * error.std()


def test_neighbours_err_by_themselves() -> None:
    error = seen(wall(2.0, plain(128)), CLEAN).depth[MIDDLE] - 2.0
    assert abs((error[:, 1:] * error[:, :-1]).mean() / error.var()) < 0.05


@pytest.mark.parametrize("metres", [1.0, 1.5, 2.0])
def test_of_a_dark_wall_as_much_is_lost_as_its_signal_says(metres: float) -> None:
    params = TimeOfFlightParams(multipath=0.0, dropout=0.0)
    signal = (30 / 255) ** 2.2 / metres**2
    lost = np.mean([(seen(wall(metres, plain(30)), params, seed).depth[MIDDLE] == 0).mean() for seed in range(4)])
    assert lost == pytest.approx(ndtr(np.log(params.least_signal / signal) / params.signal_scatter), abs=0.06)


def test_flying_pixels_lie_between_both_sides_of_an_edge() -> None:
    depth = seen(box_before_wall(plain(200)), CLEAN).depth
    rows = depth[230:340]
    flying = (rows > 1.02) & (rows < 1.98)
    edge = AZURE.cx + 0.2 * AZURE.fx
    columns = np.flatnonzero(flying.any(axis=0))
    assert columns.size and (np.abs(np.abs(columns - AZURE.cx) - (edge - AZURE.cx)) < 2.5).all()
    share = flying[:, int(edge) : int(edge) + 2].mean()
    assert share == pytest.approx(CLEAN.flying, abs=0.12)
    assert depth[depth > 0].min() > 0.98 and depth[depth > 0].max() < 2.02


def test_a_corner_looks_deeper_than_it_is_and_its_walls_do_not() -> None:
    image = seen(corner(plain(200)), TimeOfFlightParams(dropout=0.0, least_signal=0.0))
    error = (image.depth - image.true_depth)[238:338]
    middle = round(AZURE.cx)
    assert 0.004 < np.median(error[:, middle - 2 : middle + 3]) <= 0.02
    assert abs(np.median(error[:, middle + 80 : middle + 110])) < 0.001
