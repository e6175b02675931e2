# SPDX-License-Identifier: Apache-2.0
"""A lens: what it bends OpenCV straightens again, and every pixel's depth is that along its own ray."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from objreg_tools.simulation.rendering.lens import SimulatedLens
from objreg_tools.simulation.rendering.light import looking
from objreg_tools.simulation.rendering.view import draw
from objreg_tools.simulation.sensors.camera import KINECT, LENSES
from objreg_tools.simulation.world.mesh import box
from objreg_tools.simulation.world.scene import Scene
from simulation.walls import AHEAD, AMBIENT, plain, printed, wall

K = np.array([[KINECT.fx, 0, KINECT.cx], [0, KINECT.fy, KINECT.cy], [0, 0, 1]])


@pytest.mark.parametrize("name", LENSES)
def test_a_bent_picture_undistorts_to_the_plain_one(name: str) -> None:
    scene = wall(1.0, printed())
    lens = SimulatedLens(KINECT, LENSES[name])
    straight = draw(scene, AHEAD, KINECT).light
    bent = lens.bend(draw(scene, AHEAD, lens.wide)).light
    assert straight is not None and bent is not None and bent.shape == straight.shape
    again = cv2.undistort(bent, K, np.array(LENSES[name])).astype(float)
    inner = (slice(20, -20), slice(20, -20))
    seen = (cv2.undistort(np.ones(bent.shape[:2], np.uint8), K, np.array(LENSES[name])) > 0)[inner]
    deviation = straight.std()
    assert np.median(np.abs(again - straight)[inner][seen]) < 0.05 * deviation
    assert np.median(np.abs(bent.astype(float) - straight)[inner][seen]) > 2 * np.median(
        np.abs(again - straight)[inner][seen]
    )


@pytest.mark.parametrize("name", LENSES)
def test_depth_lies_on_the_floor_along_the_ray_of_every_pixel(name: str) -> None:
    floor = Scene((), (box((60.0, 60.0, 1.0), plain(128)).moved(z=-1.0),), (), AMBIENT)
    T = looking(np.array([0, 0, 1.0]), np.array([0, 2.0, 0.0]), np.array([0, 0, 1.0]))
    lens = SimulatedLens(KINECT, LENSES[name])
    nearness = lens.bend(draw(floor, T, lens.wide)).nearness
    hit = nearness > 0.2
    points = np.dstack([lens.rays, np.ones(hit.shape)])[hit] / nearness[hit][:, None]
    height = (points @ T[:3, :3].T + T[:3, 3])[:, 2]
    assert hit.mean() > 0.4 and np.abs(height).max() < 1e-3


def test_the_rays_are_those_that_opencv_projects_into_the_pixels() -> None:
    lens = SimulatedLens(KINECT, LENSES["webcam"])
    at = [(0, 0), (479, 639), (100, 500)]
    rays = np.array([[*lens.rays[p], 1.0] for p in at])
    seen = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), K, np.array(LENSES["webcam"]))[0].reshape(-1, 2)
    np.testing.assert_allclose(seen[:, ::-1], at, atol=0.03)


@pytest.mark.parametrize("distortion", [(-3.0, 0.0, 0.0, 0.0), (0.0, -40.0, 0.0, 0.0, 0.0)])
def test_a_lens_that_folds_the_picture_is_refused(distortion: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="expected one that gives every pixel of 640x480 a ray of its own, got"):
        SimulatedLens(KINECT, distortion)
