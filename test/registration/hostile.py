# SPDX-License-Identifier: Apache-2.0
"""Frames that pass every check of a data type and that no camera ever sent, through every kernel of the registrar.

A program of its own: kernels look at indices only where a process begins with ``OBJREG_CHECKED=1``, which is slower.
Prints how many places were tried; an index beside its array is an IndexError, and its exit status 1.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from itertools import count

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from objreg_ros import limits
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import Reason
from objreg_ros.data.frames import Frame, ObjectCloud
from objreg_ros.geometry import pose, rotation_from_vector
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.registrar import Registrar
from objreg_tools.simulation.drawn_place import drawn

MOST = limits.MOST_RANGE
STEP_NS = 5_000_000_000
STAMPS = count(STEP_NS, STEP_NS)
Spoil = Callable[[np.random.Generator, Frame], Frame]

seeds = st.integers(0, 2**32 - 1)
numbers = st.sampled_from([0.0, 1e-3, 0.05, 0.3, 2.0, 65.0, -MOST, MOST])


def in_front(xyz: Array) -> Array:
    """Points as `from_msg` lets them in: before the camera."""
    out = np.clip(xyz, -MOST, MOST).astype(np.float32)
    out[..., 2] = np.maximum(np.abs(out[..., 2]), limits.LEAST_RANGE)
    return out


def strewn(scale: float, share: float) -> Spoil:
    """Some of the points of every object anywhere within a scale."""

    def spoil(rng: np.random.Generator, frame: Frame) -> Frame:
        def of(cloud: ObjectCloud) -> ObjectCloud:
            xyz, some = cloud.xyz.copy(), rng.random(len(cloud)) < share
            xyz[some] += rng.uniform(-scale, scale, (int(some.sum()), 3))
            return replace(cloud, xyz=in_front(xyz))

        return replace(frame, objects=tuple(map(of, frame.objects)))

    return spoil


def beyond(name: str, value: float) -> Spoil:
    """Every third number of every object beyond all measure; the data type refuses it."""

    def spoil(rng: np.random.Generator, frame: Frame) -> Frame:
        def of(cloud: ObjectCloud) -> ObjectCloud:
            array = getattr(cloud, name).copy()
            array[::3, 0] = value
            return replace(cloud, **{name: array})

        return replace(frame, objects=tuple(map(of, frame.objects)))

    return spoil


def few(points: int) -> Spoil:
    """Objects of a few points."""

    def spoil(rng: np.random.Generator, frame: Frame) -> Frame:
        def of(cloud: ObjectCloud) -> ObjectCloud:
            kept = rng.permutation(len(cloud))[:points]
            arrays = {"xyz": cloud.xyz[kept], "normals": cloud.normals[kept], "flags": cloud.flags[kept]}
            return replace(cloud, **arrays, rgb=None if cloud.rgb is None else cloud.rgb[kept])

        return replace(frame, objects=tuple(map(of, frame.objects)))

    return spoil


def flat(value: float) -> Spoil:
    """Every point of an object in one place."""
    return lambda rng, frame: replace(
        frame,
        objects=tuple(replace(cloud, xyz=in_front(np.full_like(cloud.xyz, value))) for cloud in frame.objects),
    )


def any_normals(rng: np.random.Generator, frame: Frame) -> Frame:
    def of(cloud: ObjectCloud) -> ObjectCloud:
        normals = rng.uniform(-limits.MOST_NORMAL, limits.MOST_NORMAL, cloud.normals.shape).astype(np.float32)
        normals[rng.random(len(cloud)) < 0.3] = 0.0
        return replace(cloud, normals=normals)

    return replace(frame, objects=tuple(map(of, frame.objects)))


def any_view(scale: float, holes: float) -> Spoil:
    """A view of anything anywhere, with holes; its grey is noise, or missing."""

    def spoil(rng: np.random.Generator, frame: Frame) -> Frame:
        xyz = frame.view.xyz + rng.uniform(-scale, scale, frame.view.xyz.shape)
        xyz = np.clip(xyz, -MOST, MOST).astype(np.float32)
        xyz[rng.random(xyz.shape[:2]) < holes] = np.nan
        grey = rng.integers(0, 256, xyz.shape[:2], np.uint8) if rng.random() < 0.7 else None
        return replace(frame, view=replace(frame.view, xyz=xyz, grey=grey))

    return spoil


def any_camera(focal_length: float, centre: float) -> Spoil:
    """A lens that was never ground."""

    def spoil(rng: np.random.Generator, frame: Frame) -> Frame:
        lens = {"fx": focal_length, "fy": focal_length * rng.uniform(0.5, 2.0), "cx": centre, "cy": -centre}
        lens["fy"] = float(np.clip(lens["fy"], limits.LEAST_FOCAL_LENGTH, limits.MOST_FOCAL_LENGTH))
        return replace(frame, view=replace(frame.view, intrinsics=replace(frame.view.intrinsics, **lens)))

    return spoil


def small_view(rows: int, columns: int) -> Spoil:
    """A view of a few pixels."""

    def spoil(rng: np.random.Generator, frame: Frame) -> Frame:
        view = frame.view
        camera = replace(view.intrinsics, width=columns, height=rows)
        grey = None if view.grey is None else np.ascontiguousarray(view.grey[:rows, :columns])
        xyz = np.ascontiguousarray(view.xyz[:rows, :columns])
        return replace(frame, view=replace(view, xyz=xyz, grey=grey, intrinsics=camera))

    return spoil


def any_gravity(rng: np.random.Generator, frame: Frame) -> Frame:
    down = rng.normal(size=3)
    return replace(frame, gravity=down / np.linalg.norm(down), gravity_confidence=float(rng.random()))


def any_odometry(far: float) -> Spoil:
    """A camera that odometry carries about."""

    def spoil(rng: np.random.Generator, frame: Frame) -> Frame:
        R = rotation_from_vector(rng.normal(size=3))
        return replace(frame, T_odom_camera=pose(R, rng.uniform(-far, far, 3)))

    return spoil


spoils = st.one_of(
    st.builds(strewn, numbers.map(abs), st.sampled_from([0.01, 0.3, 1.0])),
    st.builds(few, st.sampled_from([0, 1, 2, 31, 60])),
    st.builds(flat, numbers),
    st.just(any_normals),
    st.builds(beyond, st.sampled_from(["xyz", "normals"]), st.sampled_from([3e38, -3e38, 1e30, 1e6])),
    st.builds(any_view, numbers.map(abs), st.sampled_from([0.0, 0.5, 0.99, 1.0])),
    st.builds(any_camera, st.sampled_from([1e-3, 1.0, 131.0, 1e6]), st.sampled_from([0.0, 79.5, -1e6, 1e6])),
    st.builds(small_view, st.sampled_from([1, 2, 7, 119]), st.sampled_from([1, 3, 159])),
    st.just(any_gravity),
    st.builds(any_odometry, st.sampled_from([0.1, 5.0, 1e8])),
)


class Attack:
    """A registrar that meets one place over and over, spoilt in another way each time."""

    def __init__(self) -> None:
        self.registrar = Registrar(RegistrarParams(max_keyframes=12, candidates=4))
        self.frames = self.refused = self.tried = 0

    def meet(self, seed: int, chosen: list[Spoil]) -> None:
        """One frame, and then the next good one, which has to pass."""
        rng = np.random.default_rng(seed)
        for spoiling in (chosen, []):
            self.frames += 1
            try:
                frame = drawn(next(STAMPS))
                for spoil in spoiling:
                    frame = spoil(rng, frame)
                outcomes = [self.registrar.process(frame), self.registrar.finish()]
            except ValueError:
                assert spoiling, "a good frame was refused"
                self.refused += 1
                continue
            refusals = [item.reason for outcome in outcomes for item in outcome.rejected]
            self.tried += sum(reason not in (Reason.NO_CANDIDATE, Reason.REDUNDANT) for reason in refusals)
            self.tried += sum(len(outcome.closures) for outcome in outcomes)


def main(examples: int) -> int:
    """Attack so many times."""
    attack = Attack()

    @settings(max_examples=examples, deadline=None, suppress_health_check=list(HealthCheck), database=None)
    @given(seed=seeds, chosen=st.lists(spoils, min_size=1, max_size=4))
    def run(seed: int, chosen: list[Spoil]) -> None:
        attack.meet(seed, chosen)

    run()
    print(f"{attack.frames} frames, {attack.refused} refused, {attack.tried} places tried")
    return 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1])))
