# SPDX-License-Identifier: Apache-2.0
"""All that a renderer needs of a scene, in flat arrays: triangles, textures with their mip levels, materials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from objreg_ros.data.checked import Array
from objreg_tools.simulation.world.mesh import Material, Mesh, merge

LEVELS = 9


@dataclass(frozen=True, eq=False)
class Surfaces:
    """The triangles of a scene in the world frame and what they look like.

    ``vertices``, ``normals (V, 3)``, ``uv (V, 2)`` float32; ``faces (F, 3) int32``; ``open_surface (F,) bool``;
    ``instance (F,) uint16`` (0 for the room); ``material (F,) int32``; ``detail (F,) float32`` textures per metre;
    ``casts_shadow (F,) bool``; ``texels (N, 4) uint8``; ``level_start (M, LEVELS) int32``; ``texture_size (M,) int32``;
    ``response (M, 3) float32`` specular, gloss, emission; ``loss (F,) float32`` the share of a face without depth.
    """

    vertices: Array
    normals: Array
    uv: Array
    faces: Array
    open_surface: Array
    instance: Array
    material: Array
    detail: Array
    casts_shadow: Array
    texels: Array
    level_start: Array
    texture_size: Array
    response: Array
    loss: Array


def flatten(meshes: Sequence[Mesh], instances: Sequence[int], casts_shadow: Sequence[bool]) -> Surfaces:
    """Join meshes in the world frame, each with the number of its instance and whether it throws shadows."""
    whole = merge(meshes)
    counts = [len(mesh.faces) for mesh in meshes]
    texels, starts, sizes = _texture_bank(whole.materials)
    response = np.array([(m.specular, m.gloss, m.emission) for m in whole.materials], np.float32)
    return Surfaces(
        vertices=np.ascontiguousarray(whole.vertices),
        normals=np.ascontiguousarray(whole.normals),
        uv=np.ascontiguousarray(whole.uv),
        faces=whole.faces,
        open_surface=whole.open_surface,
        instance=np.repeat(np.asarray(instances, np.uint16), counts),
        material=whole.material,
        detail=_detail(whole),
        casts_shadow=np.repeat(np.asarray(casts_shadow, bool), counts),
        texels=texels,
        level_start=starts,
        texture_size=sizes,
        response=response,
        loss=np.array([m.depth_loss for m in whole.materials], np.float32)[whole.material],
    )


def _detail(mesh: Mesh) -> Array:
    """Textures per metre of every face: the square root of its area in texture space over that in space."""
    P, uv = mesh.vertices[mesh.faces], mesh.uv[mesh.faces]
    area = np.linalg.norm(np.cross(P[:, 1] - P[:, 0], P[:, 2] - P[:, 0]), axis=1)
    a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    uv_area = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    return np.sqrt(uv_area / np.maximum(area, 1e-12)).astype(np.float32)


def _texture_bank(materials: Sequence[Material]) -> tuple[Array, Array, Array]:
    """All textures and their mip levels behind each other; a level that is too small repeats the last."""
    chunks, starts, at = [], np.zeros((len(materials), LEVELS), np.int32), 0
    for m, material in enumerate(materials):
        for level, picture in enumerate(_mip_levels(material.texture)):
            if picture is not None:
                start, at = at, at + picture.shape[0] ** 2
                chunks.append(np.pad(picture.reshape(-1, 3), ((0, 0), (0, 1))))
            starts[m, level] = start
    sizes = np.array([material.texture.shape[0] for material in materials], np.int32)
    return np.ascontiguousarray(np.concatenate(chunks)), starts, sizes


def _mip_levels(texture: Array) -> list[Array | None]:
    """The texture at 1, 1/2, 1/4 ... of its size; None beyond one texel."""
    levels: list[Array | None] = [texture]
    picture: Array = texture.astype(np.float32)
    while len(levels) < LEVELS:
        if picture.shape[0] == 1:
            levels.append(None)
            continue
        picture = (picture[::2, ::2] + picture[1::2, ::2] + picture[::2, 1::2] + picture[1::2, 1::2]) / 4
        levels.append(np.round(picture).astype(np.uint8))
    return levels
