# SPDX-License-Identifier: Apache-2.0
"""A D435: noise by the square of distance, alike over a window; holes on bare walls; fat edges; a shadow."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ndtr

from objreg_tools.simulation.params import StereoParams, StressParams
from objreg_tools.simulation.rendering.render import render
from objreg_tools.simulation.rendering.view import draw
from objreg_tools.simulation.sensors.active_stereo import IMAGERS_GREY, match, window_px
from objreg_tools.simulation.sensors.camera import CAMERAS
from objreg_tools.simulation.world.mesh import Material, box
from objreg_tools.simulation.world.scene import Scene
from simulation.walls import AHEAD, box_before_wall, plain, printed, wall

D435 = CAMERAS["realsense_d435"]
NOISE_ONLY = StereoParams(dropout=0.0, edge_jitter=0.0, projector=2.0, least_contrast=1e-5)


def seen(scene: Scene, params: StereoParams, seed: int = 0, stress: StressParams | None = None) -> np.ndarray:
    return render(scene, AHEAD, D435, seed, params, stress=stress, with_colour=False).depth


@pytest.mark.parametrize("metres", [1.0, 2.0, 3.0])
def test_the_noise_of_a_wall_grows_with_the_square_of_its_distance(metres: float) -> None:
    error = np.stack([seen(wall(metres, printed()), NOISE_ONLY, seed) - metres for seed in range(3)])
    disparity = np.hypot(0.08, 0.03125 / np.sqrt(12))
    assert error.std() == pytest.approx(metres**2 * disparity / (424.0 * 0.05), rel=0.05)
    assert abs(error.mean()) < 0.1 * error.std()


def test_the_noise_is_as_alike_as_windows_overlap() -> None:
    error = seen(wall(2.0, printed()), NOISE_ONLY.replaced(disparity_step=0.0)) - 2.0
    window = window_px(NOISE_ONLY, D435.fx)
    assert window == 11
    for lag in (3, 6, 15):
        alike = (error[:, lag:] * error[:, :-lag]).mean() / error.var()
        assert alike == pytest.approx(max(0.0, 1 - lag / window), abs=0.08)


@pytest.mark.parametrize("metres", [2.0, 3.0, 4.0])
def test_a_bare_wall_has_holes_by_how_far_the_projector_reaches(metres: float) -> None:
    params = StereoParams(dropout=0.0)
    share = np.mean([(seen(wall(metres, plain(128)), params, seed) == 0).mean() for seed in range(4)])
    dots = params.projector * IMAGERS_GREY / metres**2
    expected = 1 - ndtr(np.log(dots / params.least_contrast) / params.contrast_scatter)
    assert share == pytest.approx(expected, abs=0.05)


def test_a_printed_wall_has_no_holes_where_a_bare_one_has_many() -> None:
    params = StereoParams(dropout=0.0, projector=0.0)
    assert (seen(wall(3.0, printed()), params) > 0).mean() > 0.96
    assert (seen(wall(3.0, plain(128)), params) > 0).mean() < 0.01


def test_a_wall_that_is_white_or_dark_beside_a_grey_one_is_lost_more() -> None:
    params = StereoParams(dropout=0.0, edge_jitter=0.0)

    def lost(grey: int) -> float:
        depth = seen(_beside(grey), params)
        return float((depth[200:280, 280:360] == 0).mean())

    assert lost(128) < 0.1 and lost(8) > 0.6 and lost(255) > 0.9


def _beside(grey: int) -> Scene:
    """A patch of a grey in the middle of a wall at 2 m."""
    patch = box((0.5, 0.02, 0.5), plain(grey)).moved(y=1.99, z=-0.25)
    if grey == 255:  # shines: far above what the exposure of the rest leaves room for
        shining = Material(np.full((4, 4, 3), 255, np.uint8), emission=4.0)
        patch = box((0.5, 0.02, 0.5), shining).moved(y=1.99, z=-0.25)
    whole = wall(2.0, plain(100))
    return Scene((), (*whole.backdrop, patch), (), whole.ambient)


def test_things_grow_by_half_a_window_and_throw_a_shadow_to_their_left() -> None:
    row = seen(box_before_wall(printed()), NOISE_ONLY)[230:250]
    half = window_px(NOISE_ONLY, D435.fx) // 2
    left, right = D435.cx - 0.2 * D435.fx, D435.cx + 0.2 * D435.fx
    near = (row > 0.9) & (row < 1.1)
    assert np.flatnonzero(near.all(axis=0)).max() == pytest.approx(right + half, abs=1.5)
    assert np.flatnonzero(near.all(axis=0)).min() == pytest.approx(left - half, abs=1.5)
    width = D435.fx * 0.05 * (1 / 1.0 - 1 / 2.0)
    assert (row[:, int(left - half - width + 2) : int(left - half - 2)] == 0).mean() > 0.95
    assert (row[:, int(left - half - width - 30) : int(left - half - width - 4)] == 0).mean() < 0.05
    assert (row[:, int(right + half + 3) : int(right + half + 40)] == 0).mean() < 0.05


def test_stress_scales_depth() -> None:
    depth = seen(wall(2.0, printed()), NOISE_ONLY, stress=StressParams(depth_bias=0.01))
    assert depth[depth > 0].mean() == pytest.approx(2.02, abs=0.004)


def test_a_view_without_light_is_refused() -> None:
    view = draw(wall(1.0, plain(128)), AHEAD, D435, with_light=False)
    with pytest.raises(ValueError, match="expected a view with light"):
        match(view, np.zeros(12, np.float32), StereoParams(), StressParams(), 0)
