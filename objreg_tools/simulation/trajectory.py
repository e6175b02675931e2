# SPDX-License-Identifier: Apache-2.0
"""How a camera is carried by hand: a smooth path past waypoints at realistic speeds, with a little tremor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse, pose, rotation_from_vector

Random = np.random.Generator

STEPS = 2000
"""A path is sampled at this number of steps before it is cut into frames."""
ROUNDING_M = 0.2
"""Corners of a path are rounded over about this length."""
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Waypoint:
    """The camera at ``eye (3,)`` looks at ``target (3,)``, metres in the world."""

    eye: Array
    target: Array


@dataclass(frozen=True)
class Hand:
    """How fast and how steadily a camera is carried: m/s, deg/s, and the tremor's standard deviations in m and deg."""

    speed: float = 0.45
    turning: float = 36.0
    tremor: float = 0.003
    shake: float = 0.35
    tremor_hz: float = 1.5


def around(centre: Array, radius: float, height: float, start: float, stop: float, count: int = 9) -> list[Waypoint]:
    """Waypoints on an arc about ``centre``, from azimuth ``start`` to ``stop`` in degrees, ``height`` above it."""
    out = []
    for azimuth in np.radians(np.linspace(start, stop, count)):
        eye = centre + np.array([radius * np.cos(azimuth), radius * np.sin(azimuth), height])
        out.append(Waypoint(eye, np.asarray(centre, float)))
    return out


def carried(waypoints: Sequence[Waypoint], frames: int, rate: float, rng: Random, hand: Hand) -> tuple[Array, float]:
    """The poses ``T_world_camera (frames, 4, 4)`` on a path past the waypoints, and the frame rate in Hz.

    The whole path is walked in the given number of frames. Where ``rate`` would make that faster than the hand moves,
    the frame rate comes down instead.
    """
    if frames < 2 or len(waypoints) < 2:
        raise ValueError(f"expected at least 2 frames and 2 waypoints, got {frames} and {len(waypoints)}")
    eyes, forward = _smooth_way(waypoints)
    poses = _looking(eyes, forward)
    clock = _clock(poses, hand)
    rate = min(rate, (frames - 1) / clock[-1])
    at = np.interp(np.linspace(0, clock[-1], frames), clock, np.arange(STEPS))
    whole = np.array([_between(poses, float(s)) for s in at])
    return _shaken(whole, rate, rng, hand), rate


def _looking(eyes: Array, forward: Array) -> Array:
    """Upright camera poses (N, 4, 4) from eyes and directions of length 1."""
    right = np.cross(forward, UP)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    poses = np.tile(np.eye(4), (len(eyes), 1, 1))
    poses[:, :3, :] = np.stack([right, np.cross(forward, right), forward, eyes], axis=2)
    return poses


def _turned(poses: Array) -> Array:
    """(N - 1,) radians between consecutive poses, from the chord between their axes: exact for small turns."""
    chord = np.linalg.norm(np.diff(poses[:, :3, :3], axis=0), axis=(1, 2)) / np.sqrt(8)
    return 2 * np.arcsin(np.clip(chord, 0, 1))


def _smooth_way(waypoints: Sequence[Waypoint]) -> tuple[Array, Array]:
    """Eyes and viewing directions (STEPS, 3): straight from waypoint to waypoint, then rounded off.

    Directions go by azimuth and elevation, the shorter arc, so that the view never sinks to the floor between.
    """
    eyes = np.array([w.eye for w in waypoints], float)
    ahead = np.array([w.target for w in waypoints], float) - eyes
    azimuth = np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))
    elevation = np.arctan2(ahead[:, 2], np.linalg.norm(ahead[:, :2], axis=1))
    both = np.column_stack([eyes, azimuth, elevation])
    moved, turned = (np.linalg.norm(np.diff(part, axis=0), axis=1) for part in (eyes, both[:, 3:]))
    lengths = moved + 0.5 * turned
    s = np.concatenate([[0.0], np.cumsum(np.maximum(lengths, 1e-3))])
    dense = np.linspace(0, s[-1], STEPS)
    way = np.stack([np.interp(dense, s, column) for column in both.T], axis=1)
    way = _smoothed(way, ROUNDING_M / (s[-1] / STEPS))
    a, e = way[:, 3], way[:, 4]
    return way[:, :3], np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=1)


def _smoothed(values: Array, width: float) -> Array:
    """Columns smoothed by a Gaussian of ``width`` samples; reflected at both ends, so that the ends stay put."""
    reach = int(min(3 * width, len(values) - 1))
    if reach < 1:
        return values
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
    kernel /= kernel.sum()
    padded = np.concatenate([2 * values[0] - values[reach:0:-1], values, 2 * values[-1] - values[-2 : -reach - 2 : -1]])
    return np.stack([np.convolve(column, kernel, mode="valid") for column in padded.T], axis=1)


def _clock(poses: Array, hand: Hand) -> Array:
    """(STEPS,) seconds at every step, such that neither speed nor turning is exceeded and both change gently."""
    moved = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1) / hand.speed
    need = np.maximum(moved, np.degrees(_turned(poses)) / hand.turning)
    reach = STEPS // 50
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(need, reach, mode="edge"), 2 * reach + 1)
    gentle = _smoothed(windows.max(axis=1)[:, None], reach / 3)[:, 0]
    return np.concatenate([[0.0], np.cumsum(np.maximum(gentle, need))])


def _between(poses: Array, at: float) -> Array:
    """The pose at a fractional step."""
    k = min(int(at), len(poses) - 2)
    R = poses[k, :3, :3]
    step = inverse(poses[k]) @ poses[k + 1]
    turn = np.array([step[2, 1] - step[1, 2], step[0, 2] - step[2, 0], step[1, 0] - step[0, 1]]) / 2  # small angle
    f = at - k
    return pose(R @ rotation_from_vector(f * turn), (1 - f) * poses[k, :3, 3] + f * poses[k + 1, :3, 3])


def _shaken(poses: Array, rate: float, rng: Random, hand: Hand) -> Array:
    """The poses with the tremor of a hand: noise of a few hertz in position and direction."""
    width = max(rate / (2 * np.pi * hand.tremor_hz), 1e-3)
    noise = _smoothed(rng.standard_normal((len(poses) + 1, 6)), width)[: len(poses)]
    noise /= max(float(noise.std()), 1e-9)
    out = poses.copy()
    for k, (T, n) in enumerate(zip(poses, noise, strict=True)):
        out[k, :3, :3] = T[:3, :3] @ rotation_from_vector(np.radians(hand.shake) * n[3:])
        out[k, :3, 3] = T[:3, 3] + hand.tremor * n[:3]
    return out
