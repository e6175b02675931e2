# SPDX-License-Identifier: Apache-2.0
"""The parameters of the simulation: their defaults are a Kinect without stress, and what cannot be is refused."""

from __future__ import annotations

import pytest

from objreg_ros.params import Params
from objreg_tools.simulation.params import (
    ColourParams,
    DepthParams,
    OdometryParams,
    RigParams,
    StereoParams,
    StressParams,
    TimeOfFlightParams,
)
from objreg_tools.simulation.sensors.camera import KINECT

SHARES = [
    (DepthParams, "dropout"), (DepthParams, "grazing_cosine"), (DepthParams, "edge_dropout"), (DepthParams, "mixed"),
    (ColourParams, "vignetting"), (OdometryParams, "distance_drift"),
]  # fmt: skip
NEVER_NEGATIVE = [
    (DepthParams, "noise_floor"), (DepthParams, "noise_growth"), (DepthParams, "quantum"), (DepthParams, "baseline"),
    (DepthParams, "near"), (DepthParams, "far"), (DepthParams, "edge_jitter"), (ColourParams, "brightness"),
    (ColourParams, "blur"), (ColourParams, "shot_noise"), (ColourParams, "read_noise"), (StressParams, "warp"),
    (StressParams, "ragged"), (StressParams, "motion_blur"), (OdometryParams, "turn_drift"),
    (OdometryParams, "tilt_error"), (OdometryParams, "turn_jitter"), (OdometryParams, "distance_jitter"),
    (StereoParams, "subpixel"), (StereoParams, "projector"),
    (TimeOfFlightParams, "noise"), (TimeOfFlightParams, "multipath"), (RigParams, "rolling_ms"),
    (RigParams, "blur_ms"), (RigParams, "misregistration_px"),
]  # fmt: skip


def test_there_is_no_stress_by_default() -> None:
    assert not any(getattr(StressParams(), declaration.name) for declaration in StressParams.declarations())


def test_nothing_is_wrong_with_the_rig_by_default() -> None:
    assert RigParams().is_plain and RigParams(distortion=(0.0,) * 4).is_plain
    assert not RigParams(lag_ms=-1.0).is_plain and not RigParams(distortion=(0.1, 0.0, 0.0, 0.0)).is_plain


def test_a_d435_errs_by_4_mm_at_1_m() -> None:
    p = StereoParams()
    assert p.subpixel / (p.focal * p.baseline) == pytest.approx(0.0038, abs=1e-4)


def test_the_step_of_depth_is_an_eighth_of_a_pixel_of_a_kinects_disparity() -> None:
    depth = DepthParams()
    assert depth.quantum == pytest.approx(1 / (8 * KINECT.fx * depth.baseline), rel=0.15)


def test_the_white_balance_leaves_colours_by_default() -> None:
    assert ColourParams().tint == (1.0, 1.0, 1.0)


@pytest.mark.parametrize(("kind", "name"), SHARES)
def test_a_share_is_from_0_to_1(kind: type[Params], name: str) -> None:
    assert [getattr(kind.from_mapping({name: value}), name) for value in (0, 1)] == [0.0, 1.0]
    for value in (-0.01, 1.01):
        with pytest.raises(ValueError, match=f"{name}: expected 0 … 1, got {value}"):
            kind.from_mapping({name: value})


def test_a_length_and_a_strength_are_never_negative() -> None:
    for kind, name in NEVER_NEGATIVE:
        with pytest.raises(ValueError, match=f"{name}: expected .*, got -0.01"):
            kind.from_mapping({name: -0.01})


def test_depth_is_biased_either_way_but_not_by_more_than_a_fifth() -> None:
    assert [StressParams(depth_bias=bias).depth_bias for bias in (-0.2, 0.2)] == [-0.2, 0.2]
    for bias in (-0.21, 0.21):
        with pytest.raises(ValueError, match=r"depth_bias: expected -0\.2 … 0\.2, got"):
            StressParams(depth_bias=bias)


@pytest.mark.parametrize("occluders", [-1, 31, 2.0])
def test_occluders_are_a_small_whole_number(occluders: object) -> None:
    with pytest.raises(ValueError, match="occluders: expected"):
        StressParams.from_mapping({"occluders": occluders})
