# SPDX-License-Identifier: Apache-2.0
"""A keyframe made ready for registration, once: its sight, its surface, its features."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from typing import TypeVar, overload

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.registration.kernels.closest_points import IndexedSurface, prepare_surface
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.labels import LabelGroups
from objreg_ros.registration.params import RegistrationParams
from objreg_ros.registration.prepare.fpfh import Features, describe, salient
from objreg_ros.registration.prepare.keypoints import KeypointMatches, Keypoints, find_keypoints, match_keypoints
from objreg_ros.registration.prepare.normals import view_normals
from objreg_ros.registration.prepare.views import DETAIL_SIGMA_PX, Sight, halved, own_pixels, prepare_sight
from objreg_ros.registration.prepare.voxels import thin
from objreg_ros.registration.shapes.shape import Shape, layer_around, prepare_shape
from objreg_ros.registration.shapes.symmetry import shows_yaw
from objreg_ros.sensor import session_gravity_sigma_deg

FEATURE_VOXEL_M = 0.07  # distance of the points that carry an FPFH feature
FEATURE_RADIUS_M = 0.35  # radius of an FPFH feature: five voxels, as its authors use
FEATURE_POINTS = 600  # most points that are matched by their features: the most salient
SHAPE_POINTS = 400  # most points of an object's shape
SCENE_POINTS = 800  # most points of all objects as one shape
SURFACE_VOXEL_M = 0.03  # distance of the points of a surface that others are aligned to
OBJECT_VOXEL_M = 0.012  # distance of the points of objects, which are aligned too
OBJECT_POINTS = 400  # most of all objects that are aligned: as many as of the surface about them
GRID_CELL_M = 0.05  # of the grid that knows the closest point
GRID_REACH_M = 0.2  # how far from a surface its grid reaches: as far as ICP looks at first

Made = TypeVar("Made")


class AtNeed(Sequence[Made]):
    """So many items that are made when they are first asked for: most objects meet none of their kind.

    For several threads: two that ask at once may both make an item, and it is the same.
    """

    def __init__(self, count: int, make: Callable[[int], Made]) -> None:
        self._count, self._make = count, make
        self._made: dict[int, Made] = {}

    def __len__(self) -> int:
        return self._count

    @property
    def made(self) -> list[Made]:
        """The items that were made until now."""
        return list(self._made.values())

    @overload
    def __getitem__(self, index: int) -> Made: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Made]: ...
    def __getitem__(self, index: int | slice) -> Made | Sequence[Made]:
        if isinstance(index, slice):
            return [self[k] for k in range(*index.indices(self._count))]
        if not 0 <= index < self._count:
            raise IndexError(index)
        if index not in self._made:
            self._made[index] = self._make(index)
        return self._made[index]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prepared:
    """All that was seen, thinned: ``sight`` to look with and, at half its size, the one in ``halves``.

    The keypoints of its grey are in ``pictures``; ``surface`` to be aligned to, ``xyz`` and ``normals (M, 3)`` to
    align with; ``up (3,)`` is against gravity, or None, ``up_weight`` 0..1 how much was seen that fixes it, and
    ``up_sigma_deg`` the standard deviation of either tilt of it; ``groups`` the confusable group of each object,
    ``centroids (K, 3)`` their middles and ``extents (K,)`` m, ``shapes`` what is laid upon others and ``yaw_known``
    whether that fixes a turn; ``own`` is where the view shows each (h, w) bool; ``together`` holds all of them as one
    shape; ``middle (3,)`` that of everything: where poses are compared.
    """

    keyframe: Keyframe
    sight: Sight
    halves: Sequence[Sight]
    pictures: Sequence[Keypoints]
    surface: IndexedSurface
    features: Features
    xyz: Array
    normals: Array
    up: Array | None
    up_weight: float
    up_sigma_deg: float
    groups: tuple[str, ...]
    yaw_known: Sequence[bool]
    shapes: Sequence[Shape | None]
    own: Sequence[Array]
    together: Sequence[Shape | None]
    centroids: Array
    extents: Array
    middle: Array

    @property
    def coarse(self) -> Sight:
        """What was seen at half its size."""
        return self.halves[0]

    @property
    def keypoints(self) -> Keypoints:
        """The keypoints of its grey."""
        return self.pictures[0]

    @property
    def scene(self) -> Shape | None:
        """All objects as one shape."""
        return self.together[0]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pair:
    """Two keyframes made ready to be registered."""

    source: Prepared
    target: Prepared
    _matched: list[KeypointMatches] = field(default_factory=list, init=False, repr=False)

    @property
    def keypoint_matches(self) -> KeypointMatches:
        """The matched keypoints of the two, made when it is asked for."""
        if not self._matched:
            self._matched.append(match_keypoints(self.source.keypoints, self.target.keypoints))
        return self._matched[0]


def prepare(keyframe: Keyframe, params: RegistrationParams) -> Prepared:
    """Everything about one keyframe that does not depend on its partner.

    Surface, features and keypoints are made beside the rest: they let go of the interpreter. The keypoints, which take
    longest, are not waited for. What is derived of single objects is made when it is asked for.
    """
    normals = view_normals(keyframe.view.xyz)
    fine = thin(*seen(keyframe, normals, params), SURFACE_VOXEL_M)
    coarse = thin(*fine, FEATURE_VOXEL_M)
    points = thin(*of_objects(keyframe), OBJECT_VOXEL_M)
    groups = LabelGroups(params.label_groups)
    up = None if keyframe.gravity is None else -np.asarray(keyframe.gravity, float)
    seeing = params.context_range, DETAIL_SIGMA_PX, params.seed
    beside = ThreadPoolExecutor(1, "prepare")
    surface = beside.submit(prepare_surface, *joined(fine, points), GRID_CELL_M, GRID_REACH_M)
    features = beside.submit(describe, *coarse, FEATURE_RADIUS_M)
    keypoints = beside.submit(find_keypoints, keyframe.view, params.context_range, normals)
    beside.shutdown(wait=False)
    sight = prepare_sight(keyframe.view, *seeing)
    objects, drawn = keyframe.objects, (params.seed, sight.noise)
    layers = None if up is None else AtNeed(len(objects), partial(layer_around, keyframe, up=up))
    shapes = AtNeed(len(objects), lambda i: prepare_shape(keyframe, [i], SHAPE_POINTS, *drawn, layers))
    return Prepared(
        keyframe=keyframe,
        sight=sight,
        halves=AtNeed(1, lambda _: prepare_sight(halved(keyframe.view), *seeing)),
        pictures=AtNeed(1, lambda _: keypoints.result()),
        **_shuffled(*joined(coarse, sampled(points, OBJECT_POINTS, params.seed)), params.seed),
        up=up,
        up_weight=keyframe.gravity_confidence,
        up_sigma_deg=session_gravity_sigma_deg(keyframe.gravity_confidence),
        groups=tuple(groups.of(label) for label in keyframe.labels),
        yaw_known=AtNeed(len(objects), lambda i: shows_yaw(objects[i].cloud, up, shapes[i])),
        shapes=shapes,
        own=AtNeed(len(objects), lambda i: own_pixels(objects[i], sight)),
        together=AtNeed(1, lambda _: prepare_shape(keyframe, range(len(objects)), SCENE_POINTS, *drawn, layers)),
        centroids=np.array([item.centroid for item in keyframe.objects]).reshape(-1, 3),
        extents=np.array([item.extent for item in keyframe.objects]),
        middle=np.asarray(coarse[0].mean(axis=0) if len(coarse[0]) else np.zeros(3), float),
        surface=surface.result(),
        features=salient(features.result(), FEATURE_POINTS),
    )


def seen(keyframe: Keyframe, normals: Array, params: RegistrationParams) -> tuple[Array, Array]:
    """Points (N, 3) and normals (N, 3) of the whole view, whose normals (h, w, 3) are given, and of the context beyond.

    The whole view, not only what is near the objects: walls and furniture hold a pose that a table would let slide.
    """
    view = keyframe.view.xyz
    known = normals.any(axis=-1) & (view[..., 2] < params.context_range)
    context = keyframe.context
    return np.concatenate([view[known], context.xyz]), np.concatenate([normals[known], context.normals])


def of_objects(keyframe: Keyframe) -> tuple[Array, Array]:
    """Points (N, 3) and normals (N, 3) of all objects: finer than the view, so that what is small counts too."""
    clouds = [item.cloud for item in keyframe.objects]
    nothing = np.zeros((0, 3), np.float32)
    return (
        np.concatenate([nothing, *(cloud.xyz for cloud in clouds)]),
        np.concatenate([nothing, *(cloud.normals for cloud in clouds)]),
    )


def joined(*parts: tuple[Array, Array]) -> tuple[Array, Array]:
    """Oriented points of several parts as one."""
    return np.concatenate([xyz for xyz, _ in parts]), np.concatenate([normals for _, normals in parts])


def sampled(part: tuple[Array, Array], most: int, seed: int) -> tuple[Array, Array]:
    """At most so many of the oriented points, drawn evenly."""
    chosen = np.random.default_rng(seed).permutation(len(part[0]))[:most]
    return part[0][chosen], part[1][chosen]


def _shuffled(xyz: Array, normals: Array, seed: int) -> dict[str, Array]:
    """The points that have a normal, in a fixed random order: the first n are a fair sample."""
    order = np.random.default_rng(seed).permutation(np.flatnonzero(normals.any(axis=1)))
    return {"xyz": np.ascontiguousarray(xyz[order]), "normals": np.ascontiguousarray(normals[order])}
