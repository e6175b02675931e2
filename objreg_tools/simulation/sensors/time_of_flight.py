# SPDX-License-Identifier: Apache-2.0
"""Time of flight: depth with the errors of an Azure Kinect.

* The signal is reflectance times the cosine of the viewing angle over distance squared. The error by shot noise goes
  with one over its root: ``noise`` z / sqrt(reflectance cosine), pixel by pixel (Lange and Seitz, "Solid-state
  time-of-flight range camera", 2001). What gives too little signal has no depth: dark things, from some distance on.
* A pixel at an edge gets light from both sides and measures a depth between them: flying pixels.
* In corners light comes over the other wall too and has gone further: depth grows by up to ``multipath``. How deep in a
  corner a pixel lies is taken from how much nearer its surroundings are than a plane through it would be.

A face's reflectance is the mean of its texture: what is printed on it is not seen, nor is the infrared another colour.
"""

from __future__ import annotations

import cv2
import numpy as np
from scipy.special import ndtr

from objreg_ros.data.checked import Array
from objreg_tools.simulation.params import StressParams, TimeOfFlightParams
from objreg_tools.simulation.rendering.surfaces import Surfaces
from objreg_tools.simulation.rendering.view import RenderedView
from objreg_tools.simulation.sensors.fields import JUMP_SHARE, edges, smooth, wandered
from objreg_tools.simulation.sensors.noise import warp_field

LEAST_REFLECTANCE = 0.004
SURROUNDINGS_SHARE = 0.08
"""A corner is found by a square of this share of the picture's width."""
CORNER_SHARE = 0.02
"""Where surroundings are nearer by this share, a corner is three quarters as strong as one can be."""
HOLE_PX = 5
LOSS_PX = 24


def measure_flight(
    view: RenderedView, surfaces: Surfaces, p: TimeOfFlightParams, stress: StressParams, seed: int
) -> Array:
    """(H, W) float32: the depth in metres that the sensor measures, 0 where none."""
    shape = view.nearness.shape
    rng = np.random.default_rng([seed, 19])
    nearness = wandered(view.nearness, stress.ragged, rng)
    returned = np.maximum(view.of_faces(reflectance(surfaces)) * view.cosines(), np.float32(1e-4))
    lost = (nearness <= 0) | (rng.random(shape, np.float32) < p.dropout)
    limit = p.least_signal * np.exp(p.signal_scatter * smooth(rng, shape, HOLE_PX))
    lost |= returned * nearness**2 < limit
    lost |= ndtr(smooth(rng, shape, LOSS_PX)) < view.of_faces(surfaces.loss)
    z = np.divide(1, nearness, out=np.zeros_like(nearness), where=nearness > 0)
    z = z + p.multipath * corners(nearness)
    z, torn = _flown(z, nearness, p, rng)
    z = z + p.noise * z / np.sqrt(returned) * rng.standard_normal(shape, np.float32)
    z = z * (1 + stress.depth_bias) + warp_field(seed, shape, stress.warp) * z * z
    return np.where(lost | torn | (z < p.near) | (z > p.far), 0, z).astype(np.float32)


def reflectance(surfaces: Surfaces) -> Array:
    """(F,) float32: the mean linear grey of every face's texture, 0..1."""
    smallest = surfaces.texels[surfaces.level_start[:, -1], :3].astype(np.float32).mean(axis=1) / 255
    return np.maximum(smallest**2.2, LEAST_REFLECTANCE).astype(np.float32)[surfaces.material]


def corners(nearness: Array) -> Array:
    """(H, W) 0..1: how deep in a corner a pixel lies."""
    side = round(SURROUNDINGS_SHARE * nearness.shape[1]) | 1
    nearer = cv2.blur(nearness, (side, side), borderType=cv2.BORDER_REPLICATE) - nearness
    share = np.divide(nearer, nearness, out=np.zeros_like(nearness), where=nearness > 0)
    return np.asarray(np.tanh(np.maximum(share, 0) / CORNER_SHARE))


def _flown(z: Array, nearness: Array, p: TimeOfFlightParams, rng: np.random.Generator) -> tuple[Array, Array]:
    """Depth with flying pixels, and where depth is lost at edges; both sides are those of the pixels next to one."""
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    nearest, farthest = cv2.dilate(nearness, cross), cv2.erode(nearness, cross)
    at_edge = edges(nearness, 1) & (nearest - farthest > JUMP_SHARE * nearest) & (farthest > 0)
    luck, share = rng.random(z.shape, np.float32), rng.random(z.shape, np.float32)
    between = share / np.maximum(farthest, np.float32(1e-3)) + (1 - share) / np.maximum(nearest, np.float32(1e-3))
    return np.where(at_edge & (luck > 1 - p.flying), between, z), at_edge & (luck < p.edge_dropout)
