# SPDX-License-Identifier: Apache-2.0
"""The colour sensor: exposure, noise, blur, tint, vignetting."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_tools.simulation.params import ColourParams, StressParams
from objreg_tools.simulation.rendering.shade import LIGHT_SCALE
from objreg_tools.simulation.sensors.camera import CAMERAS, ColourSensor

PLAIN = ColourParams(blur=0.0, shot_noise=0.0, read_noise=0.0, vignetting=0.0)


def photograph(
    light: np.ndarray, params: ColourParams, stress: StressParams | None = None, seed: int = 0
) -> np.ndarray:
    sensor = ColourSensor(params, stress or StressParams(), seed)
    raw, gains = sensor.exposed(light)
    rgb = np.empty(light.shape, np.uint8)
    sensor.develop(raw, gains, (0, len(light)), rgb)
    return rgb


def even(level: float) -> np.ndarray:
    return np.full((96, 128, 3), level * LIGHT_SCALE, np.uint16)


def test_exposure_brings_any_light_to_the_wanted_grey() -> None:
    for level in (0.1, 0.5, 2.0):
        assert photograph(even(level), PLAIN).mean() == pytest.approx(0.45 * 255, abs=1.5)


def test_noise_is_as_strong_as_stated() -> None:
    params = ColourParams(blur=0.0, shot_noise=0.03, read_noise=0.01, vignetting=0.0)
    expected = 255 * np.sqrt(0.01**2 + 0.03**2 * 0.45)
    assert photograph(even(0.5), params).std(axis=(0, 1)) == pytest.approx([expected] * 3, rel=0.1)


def test_the_noise_of_the_colours_is_their_own_and_follows_from_the_seed() -> None:
    params = PLAIN.replaced(read_noise=0.03)
    first = photograph(even(0.5), params).reshape(-1, 3).astype(float)
    assert np.abs(np.corrcoef(first.T) - np.eye(3)).max() < 0.1
    assert np.array_equal(photograph(even(0.5), params).reshape(-1, 3), first)
    assert not np.array_equal(photograph(even(0.5), params, seed=1).reshape(-1, 3), first)


def test_corners_are_darker_by_the_vignetting() -> None:
    rgb = photograph(even(0.5), PLAIN.replaced(vignetting=0.4)).astype(float)
    assert rgb[0, 0].mean() / rgb[48, 64].mean() == pytest.approx(0.6, abs=0.02)


def test_tint_is_the_gain_of_each_colour() -> None:
    rgb = photograph(even(0.5), PLAIN.replaced(tint=(1.2, 1.0, 0.8))).mean(axis=(0, 1))
    assert rgb[0] / rgb[1] == pytest.approx(1.2, abs=0.02) and rgb[2] / rgb[1] == pytest.approx(0.8, abs=0.02)


def test_blur_and_motion_blur_soften_an_edge() -> None:
    light = even(0.2)
    light[:, 64:] = int(0.8 * LIGHT_SCALE)
    steepest = [
        int(np.abs(np.diff(photograph(light, params, stress)[48, :, 0].astype(int))).max())
        for params, stress in (
            (PLAIN, StressParams()),
            (PLAIN.replaced(blur=1.5), StressParams()),
            (PLAIN, StressParams(motion_blur=9.0)),
        )
    ]
    assert steepest[1] < 0.5 * steepest[0] and steepest[2] < 0.7 * steepest[0]


def test_highlights_roll_off_instead_of_wrapping() -> None:
    light = even(0.3)
    light[:8] = 65535
    rgb = photograph(light, PLAIN)
    assert rgb[:8].min() > 230


def test_a_tint_without_three_gains_is_refused() -> None:
    with pytest.raises(ValueError, match="three gains"):
        ColourSensor(ColourParams(tint=(1.0, 1.0)), StressParams(), 0)


def test_every_named_camera_has_its_centre_in_the_image() -> None:
    for camera in CAMERAS.values():
        assert abs(camera.cx - camera.width / 2) < 20 and abs(camera.cy - camera.height / 2) < 20
