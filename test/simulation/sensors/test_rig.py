# SPDX-License-Identifier: Apache-2.0
"""Cameras as they are built and timed: each error is as large as stated, and the truth is that of the stamp."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.geometry import pose, pose_error, rotation_from_vector
from objreg_tools.simulation.params import ColourParams, RigParams
from objreg_tools.simulation.rendering.render import Rendering, render
from objreg_tools.simulation.sensors.camera import KINECT, LENSES
from objreg_tools.simulation.sensors.rig import Motion, Rig
from objreg_tools.simulation.world.mesh import Material, box
from objreg_tools.simulation.world.scene import Scene
from simulation.walls import AHEAD, AMBIENT, PERFECT, box_before_wall, plain, printed

RATE = 30.0


def turned(radians: float) -> np.ndarray:
    """To the right."""
    return pose(rotation_from_vector(np.array([0.0, radians, 0.0])), np.zeros(3))


PAN_RAD_S = 0.6
QUIET = ColourParams(blur=0.0, shot_noise=0.0, read_noise=0.0, vignetting=0.0)
PAN = Motion(
    np.stack([AHEAD @ turned(k * PAN_RAD_S / RATE) for k in range(-2, 3)]),
    RATE,
)
NOW_S = 2 / RATE


def taken(scene: Scene, seed: int = 0, of: int = 0, **rig: object) -> Rendering:
    return Rig(RigParams.from_mapping(rig), KINECT, of).take_picture(scene, PAN, NOW_S, seed, PERFECT, QUIET)


def plainly(scene: Scene, T: np.ndarray) -> Rendering:
    return render(scene, T, KINECT, 0, PERFECT, QUIET)


def half_white() -> Scene:
    """A wall at 2 m, dark to the left and bright to the right."""
    bright = box((20.0, 1.0, 40.0), plain(180)).moved(x=10.0, y=2.5, z=-20.0)
    dark = box((20.0, 1.0, 40.0), plain(20)).moved(x=-10.0, y=2.5, z=-20.0)
    return Scene((), (bright, dark), (), AMBIENT)


def test_a_pose_between_two_frames_is_between_theirs_and_beyond_the_ends_the_motion_goes_on() -> None:
    for seconds in (0.0, NOW_S + 0.01, -0.02, 5 / RATE):
        degrees, cm = pose_error(PAN.at(seconds), AHEAD @ turned(PAN_RAD_S * (seconds - NOW_S)))
        assert degrees < 1e-6 and cm < 1e-9


def test_without_errors_it_is_the_plain_picture() -> None:
    one, other = taken(box_before_wall(printed())), plainly(box_before_wall(printed()), PAN.at(NOW_S))
    assert (one.depth == other.depth).all() and (one.rgb == other.rgb).all() and RigParams().is_plain


@pytest.mark.parametrize("lag", [25.0, -40.0])
def test_depth_that_lags_is_that_of_the_earlier_pose_and_colour_and_truth_are_not(lag: float) -> None:
    scene = box_before_wall(printed())
    image = taken(scene, lag_ms=lag)
    assert not RigParams(lag_ms=lag).is_plain
    then, now = plainly(scene, PAN.at(NOW_S - lag / 1000)), plainly(scene, PAN.at(NOW_S))
    assert (image.depth == then.depth).all() and (image.depth != now.depth).mean() > 0.005
    assert (image.rgb == now.rgb).all() and (image.instance == now.instance).all()
    assert (image.true_depth == now.true_depth).all() and (image.T_world_camera == PAN.at(NOW_S)).all()


def edge_of(picture: np.ndarray) -> np.ndarray:
    """For every row the column at which it passes the middle grey, with fractions of a pixel."""
    grey = picture.mean(axis=2)
    low, high = grey[:, 20:60].mean(), grey[:, -60:-20].mean()
    return picture.shape[1] - np.clip((grey - low) / (high - low), 0, 1).sum(axis=1)


def test_rows_are_exposed_one_after_the_other() -> None:
    edge = edge_of(taken(half_white(), rolling_ms=20.0).rgb)
    still = edge_of(plainly(half_white(), PAN.at(NOW_S)).rgb)
    late = 0.020 * (np.arange(480) / 479 - 0.5)
    np.testing.assert_allclose(edge - still, -KINECT.fx * PAN_RAD_S * late, atol=0.8)


def test_motion_blurs_an_edge_over_the_way_that_it_makes_in_the_exposure() -> None:
    grey = taken(half_white(), blur_ms=30.0).rgb.mean(axis=2)[240]
    linear = (grey.astype(float) / grey.max()) ** 2
    span = (linear - linear.min()) / (linear.max() - linear.min())
    width = np.interp([0.1, 0.9], span[280:360], np.arange(280, 360))
    assert width[1] - width[0] == pytest.approx(0.8 * KINECT.fx * PAN_RAD_S * 0.030, rel=0.15)
    assert width.mean() == pytest.approx(KINECT.cx, abs=1.5)


def test_a_camera_at_rest_blurs_and_rolls_nothing() -> None:
    still = Motion(np.stack([AHEAD] * 3), RATE)
    rig = Rig(RigParams(rolling_ms=20.0, blur_ms=20.0), KINECT, 0)
    image = rig.take_picture(box_before_wall(printed()), still, 1 / RATE, 0, PERFECT, QUIET)
    assert (image.rgb == plainly(box_before_wall(printed()), still.at(1 / RATE)).rgb).all()


def box_middle(depth: np.ndarray) -> np.ndarray:
    rows, columns = np.nonzero((depth > 0.9) & (depth < 1.2))
    return np.array([columns.mean(), rows.mean()])


@pytest.mark.parametrize("of", [0, 1, 2])
def test_depth_is_shifted_by_so_many_pixels_the_same_in_every_frame(of: int) -> None:
    scene = box_before_wall(plain(128))
    first, second = (taken(scene, seed, of, misregistration_px=4.0).depth for seed in (1, 2))
    away = box_middle(first) - box_middle(plainly(scene, PAN.at(NOW_S)).depth)
    assert np.linalg.norm(away) == pytest.approx(4.0, abs=0.6) and (first == second).all()


def test_the_depth_camera_is_turned_and_moved_as_stated() -> None:
    rig = Rig(RigParams(misregistration_deg=0.5, misregistration_mm=8.0), KINECT, 3)
    degrees, cm = pose_error(rig.T_colour_depth, np.eye(4))
    assert degrees == pytest.approx(0.5) and cm == pytest.approx(0.8)
    image = rig.take_picture(box_before_wall(printed()), PAN, NOW_S, 0, PERFECT, QUIET)
    assert (image.depth == plainly(box_before_wall(printed()), PAN.at(NOW_S) @ rig.T_colour_depth).depth).all()


def test_a_lens_bends_colour_and_depth_alike_and_truth_stays_straight() -> None:
    shining = Material(np.full((4, 4, 3), 255, np.uint8), emission=1.0)
    scene = box_before_wall(plain(30)).with_objects(box_before_wall(shining).objects)
    image = taken(scene, distortion=LENSES["webcam"])
    bright, near = image.rgb[..., 0] > 128, image.depth < 1.2
    assert (bright != near).mean() < 0.004
    straight = plainly(scene, PAN.at(NOW_S))
    assert (image.instance == straight.instance).all() and (near != (straight.depth < 1.2)).mean() > 0.003


def test_all_follows_from_the_seeds() -> None:
    timed = {"lag_ms": 9.0, "rolling_ms": 8.0, "blur_ms": 8.0}
    built = {"misregistration_px": 2.0, "distortion": LENSES["kinect_v1"]}
    one, other = (taken(box_before_wall(printed()), 4, 5, **timed, **built) for _ in range(2))
    assert (one.depth == other.depth).all() and (one.rgb == other.rgb).all()
