# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from docs.demo_film import FILM, PICTURE_WH, PLAN_WH, Scene, pictures, write_film
from objreg_ros.data.images import Detections, Intrinsics
from objreg_tools.truth import Truth

CAMERA = Intrinsics(fx=50.0, fy=50.0, cx=32.0, cy=24.0, width=64, height=48)


def scene(k: int) -> Scene:
    """A camera that goes a decimetre a second; of odd ones the pose alone."""
    found = Detections(
        xyxy=np.zeros((0, 4), np.float32), score=np.zeros(0, np.float32), label=(), image_hw=(48, 64), stamp_ns=k
    )
    T = np.eye(4)
    T[0, 3] = 0.1 * k
    rgb = np.full((1, 1, 3) if k % 2 else (48, 64, 3), 40 * k, np.uint8)
    return Scene(rgb, found, CAMERA, (), 1_000_000_000 * (k + 1), T)


def test_a_picture_and_what_is_known_by_then_stand_side_by_side() -> None:
    scenes = [scene(k) for k in range(6)]
    truth = Truth([(made.stamp_ns, made.T_odom_camera) for made in scenes])
    drawn = list(pictures(scenes, truth))
    assert len(drawn) == 3 and {image.shape for image in drawn} == {(PLAN_WH[1], PICTURE_WH[0] + PLAN_WH[0], 3)}
    plans = [image[:, PICTURE_WH[0] :] for image in drawn]
    assert [(plan != plan[-1, -1]).any(axis=2).sum() for plan in plans] == sorted(
        (plan != plan[-1, -1]).any(axis=2).sum() for plan in plans
    )


def test_a_film_has_all_its_pictures(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    write_film(tmp_path / "film.gif", [rng.integers(0, 255, (20, 30, 3), np.uint8) for _ in range(5)])
    with Image.open(tmp_path / "film.gif") as film:
        assert (film.n_frames, film.size) == (5, (30, 20))


def test_the_film_of_the_readme_is_small_enough_to_be_loaded() -> None:
    assert FILM.stat().st_size <= 3_000_000
