# SPDX-License-Identifier: Apache-2.0
"""Triangle meshes with normals, texture coordinates and materials, and the solids that objects are made of.

Lengths are metres, z is up. Faces are counter-clockwise seen from outside. A vertex is repeated where its normal or its
texture coordinate jumps. Texture coordinates are in textures: (0, 0) is the first row and column, 1 a full width, and
whatever lies outside 0..1 repeats.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import rotate, transform

Rect = tuple[float, float, float, float]
UNIT: Rect = (0.0, 0.0, 1.0, 1.0)
CREASE_COSINE = 0.7
"""Neighbouring surfaces that turn by less than the angle of this cosine are shaded as one smooth surface."""


SMALL_M = 0.08
"""Rounded parts up to this size are made of fewer faces."""


@dataclass(frozen=True, eq=False)
class Material:
    """How a surface looks: ``texture (S, S, 3) uint8`` sRGB with S a power of two, and its response to light.

    ``specular`` 0..1 is the strength of highlights, ``gloss`` the base-2 logarithm of their exponent, ``emission`` the
    share of the texture that shines by itself, ``depth_loss`` the share of it where a depth sensor sees nothing.
    """

    texture: Array
    specular: float = 0.05
    gloss: int = 4
    emission: float = 0.0
    depth_loss: float = 0.0

    def __post_init__(self) -> None:
        shape = self.texture.shape
        square = len(shape) == 3 and shape[0] == shape[1] and shape[2] == 3 and shape[0] & (shape[0] - 1) == 0
        if not square or self.texture.dtype != np.uint8:
            raise ValueError(f"expected a texture (S, S, 3) uint8, S a power of two; got {self.texture.dtype} {shape}")


@dataclass(frozen=True, eq=False)
class Mesh:
    """``vertices``, ``normals (V, 3)``, ``uv (V, 2)`` float32, ``faces (F, 3)``, ``material (F,)`` int32.

    ``material`` counts in ``materials``. An ``open_surface`` face is seen from both sides, others only from outside.
    """

    vertices: Array
    normals: Array
    uv: Array
    faces: Array
    material: Array
    materials: tuple[Material, ...]
    open_surface: Array = field(default_factory=lambda: np.zeros(0, bool))

    def __post_init__(self) -> None:
        if len(self.open_surface) != len(self.faces):
            object.__setattr__(self, "open_surface", np.zeros(len(self.faces), bool))

    def placed(self, T_a_b: Array) -> Mesh:
        """The mesh of frame b in frame a."""
        return replace(self, vertices=transform(T_a_b, self.vertices), normals=rotate(T_a_b, self.normals))

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Mesh:
        """The mesh shifted by x, y, z metres."""
        return replace(self, vertices=self.vertices + np.array([x, y, z], np.float32))

    def scaled(self, x: float, y: float, z: float) -> Mesh:
        """The mesh stretched along each axis by positive factors."""
        factors = np.array([x, y, z], np.float32)
        normals = self.normals / factors
        return replace(self, vertices=self.vertices * factors, normals=_unit(normals))

    def two_sided(self) -> Mesh:
        """The mesh with every face visible from both sides."""
        return replace(self, open_surface=np.ones(len(self.faces), bool))

    @property
    def bounds(self) -> Array:
        """(2, 3): the least and the greatest corner."""
        return np.stack([self.vertices.min(0), self.vertices.max(0)])


def _unit(vectors: Array) -> Array:
    norm = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return (vectors / np.maximum(norm, 1e-12)).astype(np.float32)


def merge(meshes: Iterable[Mesh]) -> Mesh:
    """One mesh of several; equal materials (the same object) are kept once."""
    parts = list(meshes)
    materials: dict[int, Material] = {id(m): m for part in parts for m in part.materials}
    index = {key: i for i, key in enumerate(materials)}
    starts = np.cumsum([0] + [len(part.vertices) for part in parts])
    renumbered = [np.array([index[id(m)] for m in part.materials], np.int32)[part.material] for part in parts]
    return Mesh(
        vertices=np.concatenate([part.vertices for part in parts]).astype(np.float32),
        normals=np.concatenate([part.normals for part in parts]).astype(np.float32),
        uv=np.concatenate([part.uv for part in parts]).astype(np.float32),
        faces=np.concatenate([part.faces + s for part, s in zip(parts, starts, strict=False)]).astype(np.int32),
        material=np.concatenate(renumbered).astype(np.int32),
        materials=tuple(materials.values()),
        open_surface=np.concatenate([part.open_surface for part in parts]),
    )


def _of_one_material(vertices: Array, normals: Array, uv: Array, faces: Array, material: Material) -> Mesh:
    return Mesh(
        vertices=np.asarray(vertices, np.float32),
        normals=_unit(np.asarray(normals)),
        uv=np.asarray(uv, np.float32),
        faces=np.asarray(faces, np.int32),
        material=np.zeros(len(faces), np.int32),
        materials=(material,),
    )


# Each side of a box: outward normal, then the directions in which u and v of its picture grow as seen from outside.
BOX_SIDES = {
    "front": ((0, -1, 0), (1, 0, 0), (0, 0, -1)),
    "right": ((1, 0, 0), (0, 1, 0), (0, 0, -1)),
    "back": ((0, 1, 0), (-1, 0, 0), (0, 0, -1)),
    "left": ((-1, 0, 0), (0, -1, 0), (0, 0, -1)),
    "top": ((0, 0, 1), (1, 0, 0), (0, -1, 0)),
    "bottom": ((0, 0, -1), (1, 0, 0), (0, 1, 0)),
}
_AXES = np.array(list(BOX_SIDES.values()), float)
_CORNERS = np.stack(
    [_AXES[:, 0] + a * _AXES[:, 1] + b * _AXES[:, 2] for a, b in ((-1, -1), (-1, 1), (1, 1), (1, -1))], 1
)
_CORNER_UV = np.array([(0, 1), (0, 3), (2, 3), (2, 1)])  # where a corner's u and v stand in a Rect


def box(
    size: Sequence[float] | Array,
    material: Material,
    atlas: dict[str, Rect] | None = None,
    tile: float | None = None,
    taper: float = 0.0,
) -> Mesh:
    """A box of ``size`` (x, y, z) that stands on z = 0, centred on the z axis.

    ``atlas`` gives the part of the texture (u0, v0, u1, v1) of each side (else the whole texture); ``tile``
    metres per texture repeats the texture instead. ``taper`` draws the top in by that share.
    """
    extent = np.asarray(size, float)
    if tile:
        spans = np.abs(_AXES[:, 1:] @ extent) / tile
        rects = np.concatenate([np.zeros((6, 2)), spans], axis=1)
    else:
        rects = np.array([(atlas or {}).get(side, UNIT) for side in BOX_SIDES])
    return boxes(extent[None], np.zeros((1, 3)), rects[None], material, taper)


def boxes(sizes: Array, feet: Array, rects: Array, material: Material, taper: float = 0.0) -> Mesh:
    """Many boxes at once: ``sizes (N, 3)``, the middle of each one's foot ``feet (N, 3)``, ``rects (N, S, 4)``.

    Only the first S of `BOX_SIDES` are made.
    """
    sides = rects.shape[1]
    corners = _CORNERS[None, :sides] * (sizes / 2)[:, None, None]
    corners[..., :2] *= np.where(_CORNERS[:sides, :, 2:] > 0, 1.0 - taper, 1.0)
    a, b = corners[:, :, 2] - corners[:, :, 0], corners[:, :, 3] - corners[:, :, 1]
    corners += (feet + sizes * [0.0, 0.0, 0.5])[:, None, None]
    normals = np.repeat(np.cross(a, b)[:, :, None], 4, axis=2)
    faces = 4 * np.arange(len(sizes) * sides)[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    uv = rects[:, :, _CORNER_UV]
    return _of_one_material(
        corners.reshape(-1, 3), normals.reshape(-1, 3), uv.reshape(-1, 2), faces.reshape(-1, 3), material
    )


def sheet(points: Array, material: Material, uv: Rect = UNIT, closed: bool = False) -> Mesh:
    """A smooth surface through a (R, C, 3) grid of points; ``closed`` joins the last column to the first.

    Seen from outside, rows run down and columns run to the right. A sheet shows its outside only; see `Mesh.two_sided`.
    """
    grid = np.asarray(points, float)
    if closed:
        grid = np.concatenate([grid, grid[:, :1]], axis=1)
    rows, columns = grid.shape[:2]
    u0, v0, u1, v1 = uv
    coordinates = np.stack(np.meshgrid(np.linspace(u0, u1, columns), np.linspace(v0, v1, rows)), axis=-1)
    normals = _grid_normals(grid, closed)
    return _of_one_material(
        grid.reshape(-1, 3), normals.reshape(-1, 3), coordinates.reshape(-1, 2), _grid_faces(rows, columns), material
    )


def _grid_faces(rows: int, columns: int) -> Array:
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    below = first + columns
    return np.concatenate([np.stack([first, below, below + 1], -1), np.stack([first, below + 1, first + 1], -1)])


def _grid_normals(grid: Array, closed: bool) -> Array:
    """Normals of a grid of points by the cross product of its central differences."""
    down = np.gradient(grid, axis=0)
    right = np.gradient(grid, axis=1)
    if closed:
        right[:, 0] = right[:, -1] = grid[:, 1] - grid[:, -2]
    normals = np.cross(down, right)
    for edge, inner in ((0, 1), (-1, -2)):  # a pole has no direction of its own: take that of its neighbours
        weak = np.linalg.norm(right[edge], axis=-1) < 1e-9
        normals[edge][weak] = normals[inner].mean(axis=0) if weak.all() else normals[inner][weak]
    return normals


def revolve(profile: Array, material: Material, segments: int = 32, uv: Rect = UNIT) -> Mesh:
    """The surface of a (K, 2) ``profile`` of (radius, z), from the top down its outside, turned about the z axis.

    u runs once around, v along the length of the profile. Turns of the profile below about 45 degrees are smooth.
    """
    outline = np.asarray(profile, float)
    steps = np.diff(outline, axis=0)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(steps, axis=1))])
    v = uv[1] + (uv[3] - uv[1]) * length / length[-1]
    flat = _unit(np.stack([-steps[:, 1], steps[:, 0]], -1)).astype(float)
    ring = np.linspace(0.0, 2 * np.pi, segments + 1)
    u = np.linspace(uv[0], uv[2], segments + 1)
    parts = []
    for k in range(len(steps)):
        ends = (_smoothed(flat, k, k - 1), _smoothed(flat, k, k + 1))
        parts.append(_band(outline[k : k + 2], np.array(ends), ring, u, v[k : k + 2], material))
    return merge(parts)


def _smoothed(flat: Array, k: int, neighbour: int) -> Array:
    """The normal of profile step ``k`` at its end towards ``neighbour``."""
    if 0 <= neighbour < len(flat) and flat[k] @ flat[neighbour] > CREASE_COSINE:
        return flat[k] + flat[neighbour]
    return flat[k]


def _band(ends: Array, end_normals: Array, ring: Array, u: Array, v: Array, material: Material) -> Mesh:
    """One step of a surface of revolution: a ring of quads between two (radius, z)."""
    c, s = np.cos(ring), np.sin(ring)
    vertices = [np.stack([r * c, r * s, np.full_like(c, z)], -1) for r, z in ends]
    normals = [np.stack([n[0] * c, n[0] * s, np.full_like(c, n[1])], -1) for n in end_normals]
    uv = [np.stack([u, np.full_like(u, value)], -1) for value in v]
    return _of_one_material(
        np.concatenate(vertices), np.concatenate(normals), np.concatenate(uv), _grid_faces(2, len(ring)), material
    )


def tube(path: Array, radius: float | Array, material: Material, segments: int = 10, tile: float = 0.1) -> Mesh:
    """A round bar of ``radius`` along a (K, 3) ``path``, closed at both ends."""
    line = np.asarray(path, float)
    tangent = _unit(np.gradient(line, axis=0)).astype(float)
    side = np.cross(tangent, np.array([0.0, 0.0, 1.0]))
    side[np.linalg.norm(side, axis=1) < 0.2] = np.array([1.0, 0.0, 0.0])
    side = _unit(side - (side * tangent).sum(1, keepdims=True) * tangent).astype(float)
    other = np.cross(tangent, side)
    around = np.linspace(0.0, -2 * np.pi, segments, endpoint=False)
    radii = np.broadcast_to(np.asarray(radius, float), len(line))[:, None, None]
    rings = side[:, None] * np.cos(around)[:, None] + other[:, None] * np.sin(around)[:, None]
    grid = line[:, None] + radii * rings
    ends = [np.repeat(line[:1, None], segments, 1), np.repeat(line[-1:, None], segments, 1)]
    grid = np.concatenate([ends[0], grid, ends[1]])
    length = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
    return sheet(grid, material, (0.0, 0.0, 1.0, max(length / tile, 0.1)), closed=True)


def cushion(size: Sequence[float] | Array, material: Material, squareness: float = 4.0, tile: float = 0.3) -> Mesh:
    """A rounded box (superellipsoid, Barr 1981) of ``size`` on z = 0; 2 is an ellipsoid, above 8 nearly a box."""
    power = 2.0 / squareness
    segments = 28 if max(size) > SMALL_M else 12
    latitude = np.linspace(np.pi / 2, -np.pi / 2, segments // 2 - 1)[:, None]
    longitude = np.linspace(0, 2 * np.pi, segments, endpoint=False)[None, :]
    c, s = _signed_power(np.cos(latitude), power), _signed_power(np.sin(latitude), power)
    x = c * _signed_power(np.cos(longitude), power)
    y = c * _signed_power(np.sin(longitude), power)
    grid = np.stack(np.broadcast_arrays(x, y, s), -1) * (np.asarray(size, float) / 2)
    mesh = sheet(grid, material, closed=True)
    planar = mesh.vertices[:, :2] / tile + mesh.vertices[:, 2:] / tile
    return replace(mesh.moved(z=size[2] / 2), uv=planar.astype(np.float32))


def _signed_power(values: Array, power: float) -> Array:
    return np.sign(values) * np.abs(values) ** power


def disc(radius: float, material: Material, z: float = 0.0) -> Mesh:
    """A flat round plate at height ``z``, facing up, with the texture's centre in its middle."""
    segments = 32
    angle = np.linspace(0, 2 * np.pi, segments, endpoint=False)
    rim = np.stack([np.cos(angle), np.sin(angle)], -1)
    points = np.concatenate([[[0.0, 0.0]], rim])
    vertices = np.concatenate([points * radius, np.full((len(points), 1), z)], axis=1)
    near, far = np.arange(segments) + 1, (np.arange(segments) + 1) % segments + 1
    faces = np.stack([np.zeros_like(near), near, far], -1)
    normals = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    return _of_one_material(vertices, normals, points * [0.5, -0.5] + 0.5, faces, material)
