# SPDX-License-Identifier: Apache-2.0
"""A keyframe made ready for registration, once: its sight, its features, its cloud."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass

import numpy as np

from objreg_ros.data import Array
from objreg_ros.registrar.features import Features, describe
from objreg_ros.registrar.icp import Surface, prepare_surface
from objreg_ros.registrar.keyframe import Keyframe
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.refine import Cloud, prepare_cloud
from objreg_ros.registrar.visibility import Sight, prepare_sight


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prepared:
    """``up (3,)`` against gravity or None; ``groups`` the confusable group of each object, ``centroids (K, 3)``."""

    keyframe: Keyframe
    sight: Sight
    features: Features
    xyz: Array
    normals: Array
    surface: Surface
    cloud: Cloud | None
    up: Array | None
    groups: tuple[str, ...]
    centroids: Array
    middle: Array


def prepare(keyframe: Keyframe, params: RegistrarParams) -> Prepared:
    """Everything about one keyframe that does not depend on its partner."""
    context = keyframe.context
    xyz, normals = thin(context.xyz, context.normals, params.feature_voxel)
    return Prepared(
        keyframe=keyframe,
        sight=prepare_sight(keyframe.view, params.context_range, params.detail_sigma, params.seed),
        xyz=xyz,
        normals=normals,
        surface=prepare_surface(context.xyz, context.normals, params.grid_cell, params.grid_reach),
        features=describe(xyz, normals, params.feature_radius),
        cloud=prepare_cloud(context.xyz, params.context_voxel),
        up=None if keyframe.gravity is None else -np.asarray(keyframe.gravity, float),
        groups=tuple(group_of(label, params.label_groups) for label in keyframe.labels),
        centroids=np.array([item.centroid for item in keyframe.objects]).reshape(-1, 3),
        middle=np.asarray(context.xyz.mean(axis=0) if len(context) else np.zeros(3), float),
    )


def group_of(label: str, groups: tuple[str, ...]) -> str:
    """The group of labels that a detector confuses with ``label``, or the label itself."""
    word = label.replace(" ", "_")
    return next((group for group in groups if word in group.split()), label)


def thin(xyz: Array, normals: Array, voxel: float) -> tuple[Array, Array]:
    """One mean point and one mean unit normal a voxel, in a fixed order."""
    if len(xyz) == 0:
        return xyz, normals
    _, owner, counts = np.unique(
        np.floor(xyz / voxel).astype(np.int64), axis=0, return_inverse=True, return_counts=True
    )
    owner = owner.ravel()
    points, directions = np.zeros((len(counts), 3)), np.zeros((len(counts), 3))
    for k in range(3):
        points[:, k] = np.bincount(owner, xyz[:, k]) / counts
        directions[:, k] = np.bincount(owner, normals[:, k])
    lengths = np.linalg.norm(directions, axis=1, keepdims=True)
    directions = np.where(lengths > 1e-6, directions / np.maximum(lengths, 1e-6), 0.0)
    return points.astype(np.float32), directions.astype(np.float32)


class Pantry:
    """The last ``size`` keyframes that were made ready."""

    def __init__(self, params: RegistrarParams, size: int = 32) -> None:
        self._params = params
        self._size = size
        self._shelf: OrderedDict[int, Prepared] = OrderedDict()

    def get(self, keyframe: Keyframe) -> Prepared:
        """The keyframe made ready, now or before; the entry holds it, so its id stays its own."""
        prepared = self._shelf.pop(id(keyframe), None) or prepare(keyframe, self._params)
        self._shelf[id(keyframe)] = prepared
        while len(self._shelf) > self._size:
            self._shelf.popitem(last=False)
        return prepared
