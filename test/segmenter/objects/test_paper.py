# SPDX-License-Identifier: Apache-2.0
"""The founding filter does what the founding document says, and no more."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from objreg_ros.data.images import DepthImage
from objreg_ros.segmenter.objects.paper import cut
from objreg_ros.segmenter.params import SegmenterParams
from segmenter.scenes import CAMERA

PAPER = SegmenterParams(preset="paper", min_points=1)
WHOLE = (0, 0, CAMERA.width, CAMERA.height)


def depths_kept(depth: np.ndarray) -> np.ndarray:
    """The depths that are left of an image, each once."""
    image = DepthImage(depth=depth.astype(np.float32), rgb=None, intrinsics=CAMERA, stamp_ns=0)
    return np.unique(cut(image, WHOLE, PAPER).xyz[:, 2])


def wall_with(*patches: tuple[int, int, float]) -> np.ndarray:
    """A wall 1 m away with patches of 20 × 20 pixels at (u, v) of other depths."""
    depth = np.ones((CAMERA.height, CAMERA.width))
    for u, v, z in patches:
        depth[v : v + 20, u : u + 20] = z
    return depth


def test_the_largest_plane_goes_and_what_is_a_centimetre_off_it_stays() -> None:
    kept = depths_kept(wall_with((100, 100, 0.95), (200, 100, 1.02), (300, 100, 0.995)))
    np.testing.assert_allclose(kept, (0.95, 1.02))


def test_what_is_beyond_either_limit_goes() -> None:
    depth = np.full((CAMERA.height, CAMERA.width), 1.7)
    depth[:100], depth[100:200] = 1.74, 1.76
    depth[240, 320] = 1.0  # off the plane, so that something stays whichever plane goes
    kept = depths_kept(depth)
    assert 1.0 in kept
    assert kept.max() < 1.75
    high = np.full((CAMERA.height, CAMERA.width), 1.72)
    high[:8] = 1.70  # y above -0.75 m: 240 px · 1.70 m / 525 px is 0.776 m
    high[200:220] = 1.5
    np.testing.assert_allclose(depths_kept(high), (1.5,))


def test_a_lone_point_far_from_the_others_stays() -> None:
    depth = wall_with((100, 100, 0.95))
    depth[400, 500] = 1.4
    np.testing.assert_allclose(depths_kept(depth), (0.95, 1.4))


def test_the_same_box_gives_the_same_points_on_whichever_thread_it_is_cut() -> None:
    rng = np.random.default_rng(5)
    depth = wall_with((100, 100, 0.95), (200, 100, 1.02))[:240] + rng.normal(0.0, 0.006, (240, CAMERA.width))
    depth = np.concatenate([depth, np.repeat(np.linspace(1.2, 0.9, 240)[:, None], CAMERA.width, axis=1)])
    with ThreadPoolExecutor(2) as pool:
        kept = list(pool.map(lambda _: depths_kept(depth).tobytes(), range(6)))
    assert len(set(kept)) == 1
