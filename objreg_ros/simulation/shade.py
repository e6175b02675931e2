# SPDX-License-Identifier: Apache-2.0
"""From triangles to colour: texture, lamps with soft shadows, ambient light, highlights.

Works pixel by pixel on the buffers of the rasteriser. Textures are taken as squares of linear light (gamma 2). The
result is linear light stored as ``sqrt(light) * LIGHT_SCALE`` in uint16: up to 16 times the white of the textures fits.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from objreg_ros.data import Array
from objreg_ros.simulation.light import Lamp, ShadowMaps
from objreg_ros.simulation.raster import Projection
from objreg_ros.simulation.surfaces import LEVELS, Surfaces

LIGHT_SCALE = 16383.0

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
    i, j = int(v), int(u)
    a, b = v - np.float32(i), u - np.float32(j)
    w00, w01 = (np.float32(1) - a) * (np.float32(1) - b), (np.float32(1) - a) * b
    w10, w11 = a * (np.float32(1) - b), a * b
    m = moments[k]
    mean = w00 * m[i, j, 0] + w01 * m[i, j + 1, 0] + w10 * m[i + 1, j, 0] + w11 * m[i + 1, j + 1, 0]
    excess = z - reference[k] - mean - np.float32(0.006)
    if excess <= 0:
        return np.float32(1.0)
    square = w00 * m[i, j, 1] + w01 * m[i, j + 1, 1] + w10 * m[i + 1, j, 1] + w11 * m[i + 1, j + 1, 1]
    variance = max(square - mean * mean, floor)
    share = variance / (variance + excess * excess)
    return max(np.float32(0.0), (share - np.float32(0.15)) * np.float32(1.0 / 0.85))  # less light bleeding


@nb.njit(cache=True, nogil=True, inline="always")
def _texel(texels, start, size, u, v, out):  # type: ignore[no-untyped-def]
    """Bilinear, repeating texture lookup of one mip level, squared to linear light."""
    mask = size - 1
    x, y = u * np.float32(size) - np.float32(0.5), v * np.float32(size) - np.float32(0.5)
    fx, fy = np.floor(x), np.floor(y)
    a, b = x - fx, y - fy
    i, j = int(fy), int(fx)
    i0, i1, j0, j1 = i & mask, (i + 1) & mask, j & mask, (j + 1) & mask
    p00, p01 = start + i0 * size + j0, start + i0 * size + j1
    p10, p11 = start + i1 * size + j0, start + i1 * size + j1
    one = np.float32(1.0)
    w00, w01, w10, w11 = (one - a) * (one - b), a * (one - b), (one - a) * b, a * b
    for c in range(3):
        value = w00 * np.float32(texels[p00, c]) + w01 * np.float32(texels[p01, c])
        value += w10 * np.float32(texels[p10, c]) + w11 * np.float32(texels[p11, c])
        value *= np.float32(1.0 / 255.0)
        out[c] = value * value


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _shade(  # type: ignore[no-untyped-def]
    nearness, triangle, y_first, y_last, camera, R, eye, bounds, edges,
    faces, normals, uv, material, detail, open_surface, texels, level_start, texture_size, response,
    lamp_position, lamp_colour, ambient, maps_moments, maps_rotation, maps_position, maps_pinhole, maps_reference, out,
):  # fmt: skip
    """Colour the rows y_first..y_last; see `shade`."""
    fx, fy, cx, cy = camera
    albedo = np.empty(3, np.float32)
    light = np.empty(3, np.float32)
    shine = np.empty(3, np.float32)
    zero, one = np.float32(0.0), np.float32(1.0)
    for y in range(y_first, y_last):
        dy = (np.float32(y) - cy) / fy
        for x in range(triangle.shape[1]):
            f = triangle[y, x]
            if f < 0:
                out[y, x, 0], out[y, x, 1], out[y, x, 2] = 0, 0, 0
                continue
            z = one / nearness[y, x]
            dx = (np.float32(x) - cx) / fx
            rx, ry, rz = (
                R[0, 0] * dx + R[0, 1] * dy + R[0, 2],
                R[1, 0] * dx + R[1, 1] * dy + R[1, 2],
                R[2, 0] * dx + R[2, 1] * dy + R[2, 2],
            )
            px, py, pz = eye[0] + z * rx, eye[1] + z * ry, eye[2] + z * rz
            ox, oy = np.float32(x - bounds[f, 0]), np.float32(y - bounds[f, 1])
            b0 = (edges[f, 0, 0] + edges[f, 0, 1] * ox + edges[f, 0, 2] * oy) * z
            b1 = (edges[f, 1, 0] + edges[f, 1, 1] * ox + edges[f, 1, 2] * oy) * z
            b2 = one - b0 - b1
            v0, v1, v2 = faces[f, 0], faces[f, 1], faces[f, 2]
            nx = b0 * normals[v0, 0] + b1 * normals[v1, 0] + b2 * normals[v2, 0]
            ny = b0 * normals[v0, 1] + b1 * normals[v1, 1] + b2 * normals[v2, 1]
            nz = b0 * normals[v0, 2] + b1 * normals[v1, 2] + b2 * normals[v2, 2]
            ray = one / np.sqrt(rx * rx + ry * ry + rz * rz)
            facing = nx * rx + ny * ry + nz * rz
            norm = one / np.sqrt(nx * nx + ny * ny + nz * nz + np.float32(1e-12))
            if open_surface[f] and facing > 0:
                norm = -norm
            nx, ny, nz = nx * norm, ny * norm, nz * norm
            # texture, at the mip level whose texels are about as large as the pixel
            m = material[f]
            size = texture_size[m]
            slant = max(abs(facing * norm) * ray, np.float32(0.1))
            spread = detail[f] * np.float32(size) * z / (fx * np.sqrt(slant))
            level = 0
            while spread > np.float32(1.4) and level < LEVELS - 1 and size > 1:
                spread *= np.float32(0.5)
                size >>= 1
                level += 1
            tu = b0 * uv[v0, 0] + b1 * uv[v1, 0] + b2 * uv[v2, 0]
            tv = b0 * uv[v0, 1] + b1 * uv[v1, 1] + b2 * uv[v2, 1]
            _texel(texels, level_start[m, level], size, tu, tv, albedo)
            # light
            opening = _lit(
                maps_moments,
                maps_rotation,
                maps_position,
                maps_pinhole,
                maps_reference,
                0,
                px,
                py,
                pz,
                np.float32(2e-3),
            )
            up = (np.float32(0.75) + np.float32(0.25) * nz) * (np.float32(0.3) + np.float32(0.7) * opening)
            for c in range(3):
                light[c] = ambient[c] * up
                shine[c] = zero
            specular, gloss = response[m, 0], int(response[m, 1])
            for k in range(lamp_position.shape[0]):
                lx, ly, lz = lamp_position[k, 0] - px, lamp_position[k, 1] - py, lamp_position[k, 2] - pz
                square = lx * lx + ly * ly + lz * lz
                inverse = one / np.sqrt(square)
                cosine = (nx * lx + ny * ly + nz * lz) * inverse
                if cosine <= 0:
                    continue
                strength = np.float32(5.0) / (one + square)
                strength *= _lit(
                    maps_moments, maps_rotation, maps_position, maps_pinhole, maps_reference, k + 1, px, py, pz,
                    np.float32(2e-5),
                )  # fmt: skip
                hx, hy, hz = lx * inverse - rx * ray, ly * inverse - ry * ray, lz * inverse - rz * ray
                h = max(zero, (nx * hx + ny * hy + nz * hz) / np.sqrt(hx * hx + hy * hy + hz * hz + np.float32(1e-12)))
                for _ in range(gloss):
                    h *= h
                peak = specular * h * strength * np.float32(1 << gloss) * np.float32(0.08)
                for c in range(3):
                    light[c] += lamp_colour[k, c] * strength * cosine
                    shine[c] += lamp_colour[k, c] * peak
            emission = response[m, 2]
            for c in range(3):
                value = albedo[c] * (light[c] + emission) + shine[c]
                out[y, x, c] = np.uint16(min(np.float32(65535.0), np.sqrt(value) * np.float32(LIGHT_SCALE)))


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
    """Colour ``rows`` of ``out (H, W, 3) uint16`` as sqrt(linear light) * LIGHT_SCALE from the rasteriser's buffers."""
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
