# SPDX-License-Identifier: Apache-2.0
"""Frames and keyframes at the size at which the registrar works, whatever size they came in.

What every later step costs is bounded by it: in time, in memory and in the store. What is smaller stays as it is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from objreg_ros import limits
from objreg_ros.data.checked import Array
from objreg_ros.data.frames import Frame, ObjectCloud, View
from objreg_ros.keyframes.fewer_points import picked
from objreg_ros.registration.keyframe import Context, Keyframe

OBJECTS = 64  # of a frame or a keyframe: those with the highest scores
OBJECT_POINTS = 2000  # of an object of a keyframe: what a row of the store holds
FRAME_POINTS = 3 * OBJECT_POINTS  # of an object of a frame: what lies in one voxel with another goes
CONTEXT_POINTS = 40_000  # of a keyframe

Item = TypeVar("Item")


def sized_frame(frame: Frame) -> Frame:
    """The frame with no more objects, points and pixels than these."""
    return replace(
        frame,
        objects=tuple(thinned(item, FRAME_POINTS) for item in best(frame.objects, lambda item: item.score)),
        support=None if frame.support is None else thinned(frame.support, FRAME_POINTS),
        view=_sized_view(frame.view),
    )


def sized_keyframe(keyframe: Keyframe) -> Keyframe:
    """The keyframe with no more objects, points and pixels than these."""
    objects = best(keyframe.objects, lambda item: item.cloud.score)
    return replace(
        keyframe,
        objects=tuple(replace(item, cloud=thinned(item.cloud, OBJECT_POINTS)) for item in objects),
        context=sized_context(keyframe.context),
        view=_sized_view(keyframe.view),
    )


def sized_context(context: Context) -> Context:
    """The context with no more than `CONTEXT_POINTS`, evenly along it."""
    if len(context) <= CONTEXT_POINTS:
        return context
    every = _stride(len(context), CONTEXT_POINTS)
    return Context(xyz=context.xyz[every], normals=context.normals[every])


def thinned(cloud: ObjectCloud, most: int) -> ObjectCloud:
    """The cloud with every so many of its points, where it has more than ``most``."""
    return cloud if len(cloud) <= most else picked(cloud, _stride(len(cloud), most))


def best(items: Sequence[Item], score: Callable[[Item], float]) -> Sequence[Item]:
    """Those with the highest scores, in the order in which they came; the first of equals."""
    if len(items) <= OBJECTS:
        return items
    chosen = sorted(range(len(items)), key=lambda i: -score(items[i]))[:OBJECTS]
    return [items[i] for i in sorted(chosen)]


def _sized_view(view: View) -> View:
    """The view of every so many pixels each way, and the mean grey about them."""
    step = view.intrinsics.step_within(limits.OWN_VIEW_PIXELS)
    if step == 1:
        return view
    left, top = (min(step // 2, size - 1) for size in (view.intrinsics.width, view.intrinsics.height))
    camera = view.intrinsics.scaled(step, (left, top))
    return View(
        xyz=np.ascontiguousarray(view.xyz[top::step, left::step]),
        grey=None if view.grey is None else _mean(view.grey, step, (camera.height, camera.width)),
        intrinsics=camera,
    )


def _mean(grey: Array, step: int, shape: tuple[int, int]) -> Array:
    """The means (h, w) uint8 of the squares of step × step pixels; of the last ones, what there is of them."""
    rows, columns = (np.minimum(np.arange(n * step), m - 1) for n, m in zip(shape, grey.shape, strict=True))
    squares = grey[np.ix_(rows, columns)].reshape(shape[0], step, shape[1], step)
    return np.asarray(squares.mean(axis=(1, 3)).round().astype(np.uint8))


def _stride(count: int, most: int) -> slice:
    return slice(None, None, 1 + (count - 1) // most)
