# SPDX-License-Identifier: Apache-2.0
"""From triangles to colour: texture, lamps with soft shadows, ambient light, highlights.

Works pixel by pixel on the buffers of the rasteriser. Textures are taken as squares of linear light (gamma 2). The
result is linear light stored as ``sqrt(light) * LIGHT_SCALE`` in uint16: up to 16 times the white of the textures fits.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.native import kernels
from objreg_tools.simulation.rendering.light import Lamp, ShadowMaps
from objreg_tools.simulation.rendering.raster import Projection
from objreg_tools.simulation.rendering.surfaces import Surfaces

_KERNELS = kernels("shade")
LIGHT_SCALE = 16383.0


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
    look = (s.faces, s.normals, s.uv, s.material, s.detail, s.open_surface,
            s.texels, s.level_start, s.texture_size, s.response)  # fmt: skip
    lights = (positions, colours, np.asarray(ambient, np.float32))
    shadows = (maps.moments, maps.rotation, maps.position, maps.pinhole, maps.reference)
    _KERNELS.shade(
        nearness, triangle, *rows, camera, R, eye, projection.bounds, projection.edges, look, lights, shadows,
        LIGHT_SCALE, out,
    )  # fmt: skip
