# SPDX-License-Identifier: Apache-2.0
"""From triangles to colour: texture, lamps with soft shadows, ambient light, highlights.

Works pixel by pixel on the buffers of the rasteriser. Textures are taken as squares of linear light (gamma 2). The
result is linear light stored as ``sqrt(light) * LIGHT_SCALE`` in uint16: up to 16 times the white of the textures fits.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from objreg_ros.data.checked import Array
from objreg_tools.simulation.rendering.light import Lamp, ShadowMaps
from objreg_tools.simulation.rendering.raster import Projection
from objreg_tools.simulation.rendering.surfaces import LEVELS, Surfaces

LIGHT_SCALE = 16383.0
FARTHEST = np.float32(1e-3)  # 1/m

ONE = np.uintp(1)
"""Unsigned indices spare numba the question whether they count from the end."""

FAST = {"contract", "arcp", "nsz", "reassoc"}


@nb.njit(cache=True, nogil=True, inline="always")
def _lit(moments, rotation, position, pinhole, reference, k, px, py, pz, floor):  # type: ignore[no-untyped-def]
    """The share 0..1 of light k that reaches a point, by Chebyshev's bound; 1 outside the map."""
    dx, dy, dz = px - position[k, 0], py - position[k, 1], pz - position[k, 2]
    z = rotation[k, 2, 0] * dx + rotation[k, 2, 1] * dy + rotation[k, 2, 2] * dz
    if z < np.float32(0.05):
        return np.float32(1.0)
    scale = pinhole[k, 0] / z
    u = (rotation[k, 0, 0] * dx + rotation[k, 0, 1] * dy + rotation[k, 0, 2] * dz) * scale + pinhole[k, 1]
    v = (rotation[k, 1, 0] * dx + rotation[k, 1, 1] * dy + rotation[k, 1, 2] * dz) * scale + pinhole[k, 1]
    size = moments.shape[1]
    if not (u >= 0 and v >= 0 and u < size - 1 and v < size - 1):
        return np.float32(1.0)
    i, j = np.uintp(v), np.uintp(u)
    below, right = i + ONE, j + ONE
    a, b = v - np.float32(i), u - np.float32(j)
    w00, w01 = (np.float32(1) - a) * (np.float32(1) - b), (np.float32(1) - a) * b
    w10, w11 = a * (np.float32(1) - b), a * b
    mean = w00 * moments[k, i, j, 0] + w01 * moments[k, i, right, 0]
    mean += w10 * moments[k, below, j, 0] + w11 * moments[k, below, right, 0]
    excess = z - reference[k] - mean - np.float32(0.006)
    if excess <= 0:
        return np.float32(1.0)
    square = w00 * moments[k, i, j, 1] + w01 * moments[k, i, right, 1]
    square += w10 * moments[k, below, j, 1] + w11 * moments[k, below, right, 1]
    variance = max(square - mean * mean, floor)
    share = variance / (variance + excess * excess)
    return max(np.float32(0.0), (share - np.float32(0.15)) * np.float32(1.0 / 0.85))  # less light bleeding


@nb.njit(cache=True, nogil=True, inline="always")
def _load(values, faces, edges, f, c, plane):  # type: ignore[no-untyped-def]
    """Column c of the corners' values of face f as `_value` takes it: value of corner 2, then the slopes beyond it."""
    last = values[faces[f, 2], c]
    first, second = values[faces[f, 0], c] - last, values[faces[f, 1], c] - last
    plane[0] = last
    for k in range(3):
        plane[1 + k] = first * edges[f, 0, k] + second * edges[f, 1, k]


@nb.njit(cache=True, nogil=True, inline="always")
def _value(plane, ox, oy, z):  # type: ignore[no-untyped-def]
    """A value at depth z, (ox, oy) pixels from the first of the face's bounds: barycentric blending in one product."""
    return plane[0] + (plane[1] + plane[2] * ox + plane[3] * oy) * z


@nb.njit(cache=True, nogil=True, inline="always")
def _mip_level(size, pixel, cosine):  # type: ignore[no-untyped-def]
    """The mip level whose texels are about as large as a pixel of ``pixel`` textures, and the level's size."""
    spread = pixel * np.float32(size)
    spread *= spread / max(cosine, np.float32(0.1))
    level = 0
    while spread > np.float32(2.0) and level < LEVELS - 1 and size > 1:
        spread *= np.float32(0.25)
        size >>= 1
        level += 1
    return level, size


@nb.njit(cache=True, nogil=True, inline="always")
def _texel(texels, start, size, u, v, out):  # type: ignore[no-untyped-def]
    """Bilinear, repeating texture lookup of one mip level, squared to linear light."""
    mask = size - 1
    x, y = u * np.float32(size) - np.float32(0.5), v * np.float32(size) - np.float32(0.5)
    fx, fy = np.floor(x), np.floor(y)
    a, b = x - fx, y - fy
    i, j = int(fy), int(fx)
    above, below = start + (i & mask) * size, start + ((i + 1) & mask) * size
    left, right = j & mask, (j + 1) & mask
    p00, p01 = np.uintp(above + left), np.uintp(above + right)
    p10, p11 = np.uintp(below + left), np.uintp(below + right)
    one = np.float32(1.0)
    w00, w01, w10, w11 = (one - a) * (one - b), a * (one - b), (one - a) * b, a * b
    for c in range(3):
        value = w00 * np.float32(texels[p00, c]) + w01 * np.float32(texels[p01, c])
        value += w10 * np.float32(texels[p10, c]) + w11 * np.float32(texels[p11, c])
        value *= np.float32(1.0 / 255.0)
        out[c] = value * value


@nb.njit(cache=True, nogil=True, inline="always", error_model="numpy", fastmath=FAST)
def _illuminate(  # type: ignore[no-untyped-def]
    px, py, pz, nx, ny, nz, vx, vy, vz, specular, gloss, lamp_position, lamp_colour, ambient,
    moments, rotation, position, pinhole, reference, light, at,
):  # fmt: skip
    """Light on a point with normal n seen along v: row ``at`` of ``light`` gets diffuse light and highlight, 3 each."""
    zero, one = np.float32(0.0), np.float32(1.0)
    opening = _lit(moments, rotation, position, pinhole, reference, 0, px, py, pz, np.float32(2e-3))
    up = (np.float32(0.75) + np.float32(0.25) * nz) * (np.float32(0.3) + np.float32(0.7) * opening)
    for c in range(3):
        light[at, c], light[at, 3 + c] = ambient[c] * up, zero
    for k in range(lamp_position.shape[0]):
        lx, ly, lz = lamp_position[k, 0] - px, lamp_position[k, 1] - py, lamp_position[k, 2] - pz
        cosine = nx * lx + ny * ly + nz * lz
        if cosine <= 0:
            continue
        square = lx * lx + ly * ly + lz * lz
        inverse = one / np.sqrt(square)
        cosine *= inverse
        strength = np.float32(5.0) / (one + square)
        strength *= _lit(moments, rotation, position, pinhole, reference, k + 1, px, py, pz, np.float32(2e-5))
        for c in range(3):
            light[at, c] += lamp_colour[k, c] * strength * cosine
        if specular < np.float32(0.01):
            continue
        hx, hy, hz = lx * inverse - vx, ly * inverse - vy, lz * inverse - vz
        h = max(zero, (nx * hx + ny * hy + nz * hz) / np.sqrt(hx * hx + hy * hy + hz * hz + np.float32(1e-12)))
        for _ in range(gloss):
            h *= h
        peak = specular * h * strength * np.float32(1 << gloss) * np.float32(0.08)
        for c in range(3):
            light[at, 3 + c] += lamp_colour[k, c] * peak


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST, inline="always")
def _enlighten(  # type: ignore[no-untyped-def]
    f, m, at, z, dx, dy, ox, oy, fx, R, eye, edges, faces, normals, detail, open_surface, texture_size,
    response, lamp_position, lamp_colour, ambient, moments, rotation, position, pinhole, reference,
    normal, lights, levels,
):  # fmt: skip
    """Find the light and the mip level of a pixel on face ``f`` of material ``m``, into the rows ``at``.

    ``dx, dy`` are its ray at depth 1, ``ox, oy`` its place in the face's bounds; ``normal (3, 4)`` is scratch.
    """
    one = np.float32(1.0)
    rx = R[0, 0] * dx + R[0, 1] * dy + R[0, 2]
    ry = R[1, 0] * dx + R[1, 1] * dy + R[1, 2]
    rz = R[2, 0] * dx + R[2, 1] * dy + R[2, 2]
    for c in range(3):
        _load(normals, faces, edges, f, c, normal[c])
    nx, ny, nz = _value(normal[0], ox, oy, z), _value(normal[1], ox, oy, z), _value(normal[2], ox, oy, z)
    ray = one / np.sqrt(rx * rx + ry * ry + rz * rz)
    norm = one / np.sqrt(nx * nx + ny * ny + nz * nz + np.float32(1e-12))
    facing = (nx * rx + ny * ry + nz * rz) * norm
    if open_surface[f] and facing > 0:
        norm = -norm
    levels[at, 0], levels[at, 1] = _mip_level(texture_size[m], detail[f] * z / fx, abs(facing) * ray)
    _illuminate(
        eye[0] + z * rx, eye[1] + z * ry, eye[2] + z * rz, nx * norm, ny * norm, nz * norm,
        rx * ray, ry * ray, rz * ray, response[m, 0], int(response[m, 1]),
        lamp_position, lamp_colour, ambient,
        moments, rotation, position, pinhole, reference, lights, at,
    )  # fmt: skip


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _shade(  # type: ignore[no-untyped-def]
    nearness, triangle, y_first, y_last, camera, R, eye, bounds, edges,
    faces, normals, uv, material, detail, open_surface, texels, level_start, texture_size, response,
    lamp_position, lamp_colour, ambient, moments, rotation, position, pinhole, reference, out,
):  # fmt: skip
    """Colour the rows y_first..y_last; see `shade`.

    Light changes slowly over a face: it is found for every second pixel of every second row, and for the others only
    where they see another face than that one, and so is the mip level. ``y_first`` is even.
    """
    fx, fy, cx, cy = camera
    width = triangle.shape[1]
    albedo = np.empty(3, np.float32)
    own = (width + 1) // 2  # the last row of ``lights`` is for a pixel that keeps its light to itself
    lights = np.empty((own + 1, 6), np.float32)
    levels = np.empty((own + 1, 2), np.int32)
    lit_face = np.full(own, -1, np.int32)
    normal, picture = np.empty((3, 4), np.float32), np.empty((2, 4), np.float32)
    one, loaded, m = np.float32(1.0), -1, 0
    for y in range(y_first, y_last):
        dy = (np.float32(y) - cy) / fy
        for x in range(width):
            f, j = triangle[y, x], x >> 1
            keeps = ((x | y) & 1) == 0
            shared = not keeps and lit_face[j] == f
            if keeps:
                lit_face[j] = f
            if f < 0:
                out[y, x, 0], out[y, x, 1], out[y, x, 2] = 0, 0, 0
                continue
            z = one / nearness[y, x]
            if f != loaded:
                loaded, m = f, material[f]
                for c in range(2):
                    _load(uv, faces, edges, f, c, picture[c])
            ox, oy = np.float32(x - bounds[f, 0]), np.float32(y - bounds[f, 1])
            at = j if keeps or shared else own
            if not shared:
                beside = np.float32(0.5) if keeps else np.float32(0.0)  # px: the light of a block is that of its middle
                lit_z = one / max(nearness[y, x] + beside * _slope(edges[f]), FARTHEST)
                dx, lit_dy = (np.float32(x) + beside - cx) / fx, dy + beside / fy
                _enlighten(
                    f, m, at, lit_z, dx, lit_dy, ox + beside, oy + beside, fx, R, eye, edges, faces, normals,
                    detail, open_surface, texture_size, response, lamp_position, lamp_colour, ambient,
                    moments, rotation, position, pinhole, reference, normal, lights, levels,
                )  # fmt: skip
            start = level_start[m, levels[at, 0]]
            tu, tv = _value(picture[0], ox, oy, z), _value(picture[1], ox, oy, z)
            _texel(texels, start, levels[at, 1], tu, tv, albedo)
            for c in range(3):
                value = albedo[c] * (lights[at, c] + response[m, 2]) + lights[at, 3 + c]
                out[y, x, c] = np.uint16(min(np.float32(65535.0), np.sqrt(value) * np.float32(LIGHT_SCALE)))


@nb.njit(cache=True, nogil=True, inline="always")
def _slope(edges):  # type: ignore[no-untyped-def]
    """How much nearness grows one pixel to the right and one down, on the face of ``edges (3, 3)``."""
    total = np.float32(0.0)
    for k in range(3):
        total += edges[k, 1] + edges[k, 2]
    return total


def shade(
    projection: Projection,
    nearness: Array,
    triangle: Array,
    surfaces: Surfaces,
    T_world_camera: Array,
    lamps: tuple[Lamp, ...],
    ambient: Array,
    maps: ShadowMaps,
    rows: tuple[int, int],
    out: Array,
) -> None:
    """Colour ``rows`` of ``out (H, W, 3) uint16`` as sqrt(linear light) * LIGHT_SCALE from the rasteriser's buffers.

    The first row is even.
    """
    s, i = surfaces, projection.intrinsics
    camera = (np.float32(i.fx), np.float32(i.fy), np.float32(i.cx), np.float32(i.cy))
    R, eye = T_world_camera[:3, :3].astype(np.float32), T_world_camera[:3, 3].astype(np.float32)
    positions = np.array([lamp.position for lamp in lamps], np.float32).reshape(-1, 3)
    colours = np.array([lamp.colour for lamp in lamps], np.float32).reshape(-1, 3)
    _shade(
        nearness, triangle, *rows, camera, R, eye, projection.bounds, projection.edges,
        s.faces, s.normals, s.uv, s.material, s.detail, s.open_surface,
        s.texels, s.level_start, s.texture_size, s.response,
        positions, colours, np.asarray(ambient, np.float32),
        maps.moments, maps.rotation, maps.position, maps.pinhole, maps.reference, out,
    )  # fmt: skip
