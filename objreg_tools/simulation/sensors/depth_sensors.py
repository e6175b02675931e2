# SPDX-License-Identifier: Apache-2.0
"""The depth sensors by what their parameters are: structured light, active stereo, time of flight."""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_tools.simulation.params import DepthSensing, StereoParams, StressParams, TimeOfFlightParams
from objreg_tools.simulation.rendering.surfaces import Surfaces
from objreg_tools.simulation.rendering.view import RenderedView, in_bands
from objreg_tools.simulation.sensors.active_stereo import match
from objreg_tools.simulation.sensors.noise import DepthSensor
from objreg_tools.simulation.sensors.time_of_flight import measure_flight


def needs_light(params: DepthSensing) -> bool:
    """Whether the sensor looks at the light of a view: stereo matches by it."""
    return isinstance(params, StereoParams)


def measure(
    view: RenderedView, surfaces: Surfaces, params: DepthSensing, stress: StressParams, seed: int, threads: int = 1
) -> Array:
    """(H, W) float32: what the sensor measures of a view, in metres, 0 where nothing is; ``seed`` draws its noise."""
    if isinstance(params, StereoParams):
        return match(view, surfaces.loss, params, stress, seed)
    if isinstance(params, TimeOfFlightParams):
        return measure_flight(view, surfaces, params, stress, seed)
    shape = view.nearness.shape
    measured = np.empty(shape, np.float32)
    sensor = DepthSensor(params, stress, seed, (shape[0], shape[1]), surfaces)
    sense = (view.projection, view.nearness, view.triangle)
    in_bands(lambda a, b: sensor.sense(*sense, (a, b), measured), shape[0], threads)
    return measured
