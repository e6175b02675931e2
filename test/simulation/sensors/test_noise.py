# SPDX-License-Identifier: Apache-2.0
"""The depth sensor: its error is as large and as correlated as stated and as that of real Kinect clouds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from objreg_ros.data.images import Intrinsics
from objreg_tools.simulation.params import DepthParams, StressParams
from objreg_tools.simulation.rendering.light import looking
from objreg_tools.simulation.rendering.render import Rendering, render
from objreg_tools.simulation.scenarios import make_plan
from objreg_tools.simulation.sensors.camera import KINECT
from objreg_tools.simulation.sensors.noise import warp_field
from objreg_tools.simulation.world.mesh import Material, box
from objreg_tools.simulation.world.model import ObjectModel, Symmetry
from objreg_tools.simulation.world.scene import Placed, Scene
from simulation.clouds import read_organised_pcd

GREY = Material(np.full((4, 4, 3), 128, np.uint8))
PATCH = 24
LAGS = (1, 2, 4)


def wall_at(metres: float, seed: int = 0, material: Material = GREY, depth: DepthParams | None = None) -> Rendering:
    """A wall straight ahead."""
    scene = Scene((), (box((40.0, 1.0, 40.0), material).moved(y=metres + 0.5, z=-20.0),), (), np.full(3, 0.5))
    view = looking(np.zeros(3), np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]))
    return render(scene, view, KINECT, seed, depth, with_colour=False)


def patches(depth: np.ndarray) -> list[tuple[float, float, np.ndarray, np.ndarray]]:
    """Of every flat patch: depth, standard deviation about its plane, correlation along rows and along columns.

    A plane is linear in 1/z over the image, whatever the camera.
    """
    out = []
    rows, columns = np.mgrid[0:PATCH, 0:PATCH]
    for y in range(0, depth.shape[0] - PATCH + 1, PATCH):
        for x in range(0, depth.shape[1] - PATCH + 1, PATCH):
            z = depth[y : y + PATCH, x : x + PATCH].astype(float)
            valid = z > 0
            if valid.sum() < 500:
                continue
            A = np.stack([rows[valid], columns[valid], np.ones(valid.sum())], -1)
            plane = np.linalg.lstsq(A, 1 / z[valid], rcond=None)[0]
            error = np.full(z.shape, np.nan)
            error[valid] = z[valid] - 1 / (A @ plane)
            deviation = float(np.nanstd(error))
            if deviation < 0.012:  # else an edge
                along = np.array([np.nanmean(error[:, k:] * error[:, :-k]) for k in LAGS]) / deviation**2
                across = np.array([np.nanmean(error[k:] * error[:-k]) for k in LAGS]) / deviation**2
                out.append((float(z[valid].mean()), deviation, along, across))
    return out


def typical(
    found: list[tuple[float, float, np.ndarray, np.ndarray]], metres: float
) -> tuple[float, np.ndarray, np.ndarray]:
    """The medians of the patches within 0.1 m of a depth."""
    near = [p for p in found if abs(p[0] - metres) < 0.1]
    assert len(near) >= 20
    deviation, along, across = (np.median([p[k] for p in near], axis=0) for k in (1, 2, 3))
    return float(deviation), along, across


@pytest.mark.parametrize("metres", [0.6, 1.0, 1.5, 2.5, 4.0])
def test_the_noise_of_a_wall_is_that_of_the_model(metres: float) -> None:
    image = wall_at(metres)
    error = image.depth[image.depth > 0] - metres
    model, step = 0.0012 + 0.0019 * (metres - 0.4) ** 2, 0.00285 * metres**2
    assert error.std() == pytest.approx(np.hypot(model, step / np.sqrt(12)), rel=0.1)
    assert abs(error.mean()) < 0.2 * model


def test_depth_comes_in_steps_that_grow_with_the_square_of_distance() -> None:
    for metres in (1.0, 3.0):
        levels = np.unique(wall_at(metres).depth)
        levels = levels[(levels > 0) & (np.abs(levels - metres) < 0.05 * metres)]
        assert np.median(np.diff(levels)) == pytest.approx(0.00285 * metres**2, rel=0.35)


def test_nothing_is_measured_beyond_the_range() -> None:
    assert not wall_at(5.5).depth.any() and not wall_at(0.3).depth.any()
    assert wall_at(5.5, depth=DepthParams(far=8.0)).depth.any()


def test_a_perfect_sensor_measures_the_truth() -> None:
    perfect = DepthParams(
        noise_floor=0.0, noise_growth=0.0, quantum=0.0, baseline=0.0, dropout=0.0, edge_jitter=0.0,
        edge_dropout=0.0, mixed=0.0, grazing_cosine=0.0, near=0.0, far=50.0,
    )  # fmt: skip
    image = box_before_wall(perfect)
    np.testing.assert_allclose(image.depth, image.true_depth, rtol=1e-6)


def box_before_wall(depth: DepthParams | None = None, stress: StressParams | None = None) -> Rendering:
    model = ObjectModel("book", box((0.4, 0.1, 0.4), GREY), Symmetry())
    T = np.eye(4)
    T[:3, 3] = [0.0, 1.05, -0.2]
    scene = Scene((Placed(1, model, T),), (box((40.0, 1.0, 40.0), GREY).moved(y=2.5, z=-20.0),), (), np.full(3, 0.5))
    view = looking(np.zeros(3), np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]))
    return render(scene, view, KINECT, 1, depth, stress=stress, with_colour=False)


def test_the_shadow_of_a_near_object_lies_to_its_left_and_is_as_wide_as_parallax_says() -> None:
    row = box_before_wall().depth[220:260]
    left, right = 319.5 - 105.0, 319.5 + 105.0
    width = 525.0 * 0.075 * (1 / 1.0 - 1 / 2.0)
    assert (row[:, int(left - width + 4) : int(left - 4)] == 0).mean() > 0.95
    assert (row[:, int(left - width - 30) : int(left - width - 6)] == 0).mean() < 0.05
    assert (row[:, int(right + 6) : int(right + 40)] == 0).mean() < 0.05


def test_edges_are_ragged_and_more_so_under_stress() -> None:
    def roughness(stress: StressParams) -> float:
        row = box_before_wall(stress=stress).depth[150:330, 380:470]
        last = [np.flatnonzero((line > 0.9) & (line < 1.1)).max() for line in row]
        return float(np.std(last))

    assert 0.3 < roughness(StressParams()) < roughness(StressParams(ragged=2.0))


def test_grazing_views_lose_depth() -> None:
    floor = Scene((), (box((60.0, 60.0, 1.0), GREY).moved(z=-1.0),), (), np.full(3, 0.5))
    image = render(
        floor, looking(np.array([0, 0, 0.5]), np.array([0, 5.0, 0.5]), np.array([0, 0, 1.0])), with_colour=False
    )
    steep, grazing = (
        (image.true_depth > 0.9) & (image.true_depth < 1.3),
        (image.true_depth > 3) & (image.true_depth < 4.5),
    )
    assert (image.depth[steep] > 0).mean() > 0.95 and (image.depth[grazing] > 0).mean() < 0.6


def test_surfaces_that_shine_have_holes_of_the_stated_share() -> None:
    shining = Material(GREY.texture, depth_loss=0.4)
    lost = np.mean([(wall_at(1.0, seed, shining).depth == 0).mean() for seed in range(4)])
    assert lost == pytest.approx(0.4, abs=0.08)


def test_stress_scales_and_bends_depth() -> None:
    scene = Scene((), (box((40.0, 1.0, 40.0), GREY).moved(y=2.5, z=-20.0),), (), np.full(3, 0.5))
    view = looking(np.zeros(3), np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]))
    biased = render(scene, view, stress=StressParams(depth_bias=0.01), with_colour=False).depth
    assert np.median(biased[biased > 0]) == pytest.approx(2.02, abs=0.006)
    bent = render(scene, view, stress=StressParams(warp=0.003), with_colour=False).depth
    middle = [np.median(bent[y : y + 40, x : x + 40]) for y in range(0, 480, 40) for x in range(0, 640, 40)]
    assert np.std(middle) == pytest.approx(0.003 * 4, rel=0.3)


def test_the_warp_is_smooth_and_as_strong_as_stated() -> None:
    field = warp_field(3, (480, 640), 0.002)
    assert field.std() == pytest.approx(0.002, rel=1e-3)
    assert np.abs(np.diff(field, axis=1)).max() < 0.0002
    assert not warp_field(3, (480, 640), 0.0).any()


def test_another_camera_has_the_same_noise_per_distance() -> None:
    narrow = Intrinsics(fx=800.0, fy=800.0, cx=319.5, cy=239.5, width=640, height=480)
    scene = Scene((), (box((40.0, 1.0, 40.0), GREY).moved(y=1.5, z=-20.0),), (), np.full(3, 0.5))
    view = looking(np.zeros(3), np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]))
    depth = render(scene, view, narrow, with_colour=False).depth
    assert depth[depth > 0].std() == pytest.approx(np.hypot(0.0012 + 0.0019 * 0.36, 0.00285 / np.sqrt(12)), rel=0.12)


def test_noise_is_as_strong_and_as_correlated_as_in_real_clouds(shared: Path) -> None:
    real, simulated = [], []
    for path in sorted((shared / "data" / "mosd_learn").glob("*.pcd")):
        real += patches(read_organised_pcd(path))
    plan = make_plan("loop", 0, frames=24)
    for k in range(0, 24, 3):
        simulated += patches(render(plan.scenes[0], plan.T_world_camera[k], seed=k, with_colour=False).depth)
    for metres in (1.0, 1.2, 1.4):
        deviation, along, across = typical(real, metres)
        made, made_along, made_across = typical(simulated, metres)
        assert made == pytest.approx(deviation, rel=0.3)
        np.testing.assert_allclose(made_along, along, atol=0.15)
        np.testing.assert_allclose(made_across, across, atol=0.15)
