# SPDX-License-Identifier: Apache-2.0
"""Flat arrays of a scene: instances, mip levels, texture density."""

from __future__ import annotations

import numpy as np

from objreg_tools.simulation.rendering.surfaces import LEVELS, flatten
from objreg_tools.simulation.world.mesh import Material, box

GREY = Material(np.full((4, 4, 3), 100, np.uint8), specular=0.2, gloss=5, emission=0.1, depth_loss=0.3)
RAMP = Material(np.repeat(np.arange(0, 256, 16, dtype=np.uint8)[None, :, None], 16, axis=0).repeat(3, axis=2))


def test_faces_carry_the_number_of_their_instance_and_their_material() -> None:
    s = flatten([box((1, 1, 1), GREY), box((1, 1, 1), RAMP)], [0, 7], [True, False])
    assert s.instance.tolist() == [0] * 12 + [7] * 12
    assert s.casts_shadow.tolist() == [True] * 12 + [False] * 12
    np.testing.assert_allclose(s.response[s.material[0]], (0.2, 5, 0.1), rtol=1e-6)
    assert s.loss[0] == np.float32(0.3) and s.loss[-1] == 0


def test_mip_levels_halve_the_texture_down_to_its_mean() -> None:
    s = flatten([box((1, 1, 1), RAMP)], [1], [True])
    assert s.texture_size.tolist() == [16]
    starts = s.level_start[0]
    assert np.diff(starts[:5]).tolist() == [256, 64, 16, 4]
    np.testing.assert_allclose(s.texels[starts[4], :3], RAMP.texture.mean(axis=(0, 1)), atol=1.5)
    assert (starts[4:] == starts[4]).all() and len(starts) == LEVELS


def test_detail_is_textures_per_metre() -> None:
    np.testing.assert_allclose(flatten([box((2, 2, 2), RAMP)], [1], [True]).detail, 0.5, rtol=1e-5)
    np.testing.assert_allclose(flatten([box((2, 2, 2), RAMP, tile=0.25)], [1], [True]).detail, 4.0, rtol=1e-5)
