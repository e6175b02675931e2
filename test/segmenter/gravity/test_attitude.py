# SPDX-License-Identifier: Apache-2.0
"""Gravity from an IMU whose motion is known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from objreg_ros.data.frames import FeltGravity, ImuSample
from objreg_ros.geometry import quaternion_from_rotation, rotation_from_vector
from objreg_ros.segmenter.gravity.attitude import BIAS_DEG, WORD_NS, AttitudeFilter, G

HZ = 200
STEP_NS = 10**9 // HZ
DOWN = np.array([0.0, 1.0, 0.0])  # of an upright camera
SMALL_TURN = (1e-6, -2e-6, 1e-6)  # rad/s: a gyroscope at rest that is there
BIASED_TURN = (0.005, -0.005, 0.004)  # half a degree in a second


def sample(k: int, acceleration: object = None, turn: object = None, **more: object) -> ImuSample:
    def held(values: object) -> np.ndarray | None:
        return None if values is None else np.array(values, float)

    fields = {"orientation": None, "stamp_ns": 10**9 + k * STEP_NS, **more}
    return ImuSample(acceleration=held(acceleration), angular_velocity=held(turn), **fields)


def tilted(degrees: float) -> np.ndarray:
    """The way things fall in a camera that is tilted about its x axis."""
    return rotation_from_vector(np.array([np.radians(degrees), 0.0, 0.0])) @ DOWN


def off_deg(filter_: AttitudeFilter, truth: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip(np.dot(filter_._falls, truth), -1.0, 1.0))))


def run(filter_: AttitudeFilter, first: int, count: int, make: Callable[[int], ImuSample]) -> list[FeltGravity]:
    return [output for k in range(first, first + count) if (output := filter_.add_imu(make(k))) is not None]


@pytest.mark.parametrize("degrees", [0.0, 30.0, -75.0, 180.0])
@pytest.mark.parametrize(("turn", "most_deg"), [(SMALL_TURN, 0.1), (BIASED_TURN, 0.5)])
def test_an_imu_at_rest_gives_its_tilt_and_becomes_surer(
    degrees: float, turn: tuple[float, float, float], most_deg: float
) -> None:
    rng = np.random.default_rng(0)
    filter_ = AttitudeFilter()
    noisy = [-G * tilted(degrees) + rng.normal(0.0, 0.05, 3) for _ in range(10 * HZ)]
    outputs = run(filter_, 0, 10 * HZ, lambda k: sample(k, noisy[k], turn))
    assert off_deg(filter_, tilted(degrees)) < most_deg
    assert outputs[0].gravity_sigma_deg > 3.0 and BIAS_DEG < outputs[-1].gravity_sigma_deg < 1.5


def test_a_direction_that_was_wrong_at_the_start_turns_right_while_the_gyroscope_carries_it() -> None:
    filter_ = AttitudeFilter()
    filter_.add_imu(sample(0, -G * DOWN + np.array([5.0, 0.0, 0.0]), SMALL_TURN))  # pushed from the side
    assert off_deg(filter_, DOWN) > 25.0 and filter_.sigma_deg > 20.0
    rate = np.radians(40.0)  # about x, for two seconds
    run(filter_, 1, 2 * HZ, lambda k: sample(k, -G * tilted(-np.degrees(rate) * k / HZ), (rate, 0.0, 0.0)))
    assert off_deg(filter_, tilted(-80.0)) < 1.0 and filter_.sigma_deg < 2.5


def test_the_gyroscope_alone_carries_the_direction_on_and_it_grows_less_sure() -> None:
    filter_ = AttitudeFilter()
    run(filter_, 0, 2 * HZ, lambda k: sample(k, -G * DOWN, SMALL_TURN))
    before = filter_.sigma_deg
    rate = np.radians(90.0)
    run(filter_, 2 * HZ, HZ, lambda k: sample(k, None, (0.0, 0.0, rate)))
    assert off_deg(filter_, np.array([1.0, 0.0, 0.0])) < 0.6
    assert before < filter_.sigma_deg < before + 1.5
    assert filter_.counts == {"no_acceleration": HZ}


@pytest.mark.parametrize("push", [(3.0, 0.0, 0.0), (0.0, 0.0, -3.0), (2.0, 0.0, 2.2)])
def test_an_acceleration_of_3_for_a_second_moves_it_by_less_than_half_a_degree_and_makes_it_less_sure(
    push: tuple[float, float, float],
) -> None:
    filter_ = AttitudeFilter()
    run(filter_, 0, 10 * HZ, lambda k: sample(k, -G * DOWN, SMALL_TURN))
    before = filter_.sigma_deg
    run(filter_, 10 * HZ, HZ, lambda k: sample(k, -G * DOWN + np.array(push), SMALL_TURN))
    assert off_deg(filter_, DOWN) < 0.5
    assert filter_.sigma_deg > before + 0.05


def test_in_a_hand_the_error_is_what_the_deviation_says() -> None:
    squares, errors = [], []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        filter_, R, turn, push = AttitudeFilter(), np.eye(3), np.zeros(3), np.zeros(3)
        bias = np.radians(rng.normal(0.0, 0.7, 3))
        for k in range(15 * HZ):
            turn = turn * (1.0 - 2.0 / HZ) + rng.normal(0.0, np.radians(40.0) * np.sqrt(4.0 / HZ), 3)
            push = push * (1.0 - 3.3 / HZ) + rng.normal(0.0, 0.6 * np.sqrt(6.6 / HZ), 3)
            R = R @ rotation_from_vector(turn / HZ)
            felt = R.T @ (np.array([0.0, 0.0, G]) + push) + rng.normal(0.0, 0.05, 3)
            filter_.add_imu(sample(k, felt, turn + bias + rng.normal(0.0, 0.005, 3)))
            errors.append(off_deg(filter_, -R[2]))
            squares.append(errors[-1] ** 2 / filter_.sigma_deg**2 / 2.0)
    assert 0.1 < np.mean(squares) < 1.5 and np.percentile(errors, 95) < 6.0


def test_how_often_an_imu_speaks_makes_it_no_surer() -> None:
    sure = []
    for every in (1, 4):
        filter_ = AttitudeFilter()
        for k in range(0, 3 * HZ, every):
            filter_.add_imu(sample(k, -G * DOWN, SMALL_TURN))
        sure.append(filter_.sigma_deg)
    assert sure[0] == pytest.approx(sure[1], rel=0.02)


def test_without_a_gyroscope_the_direction_follows_a_camera_that_turns_and_is_less_sure() -> None:
    filter_ = AttitudeFilter()
    run(filter_, 0, 3 * HZ, lambda k: sample(k, -G * tilted(30.0 * k / HZ)))
    assert off_deg(filter_, tilted(90.0)) < 5.0
    assert filter_.sigma_deg > 5.0


def test_zeros_of_a_gyroscope_that_never_spoke_are_no_stillness_and_later_ones_are() -> None:
    filter_ = AttitudeFilter()
    run(filter_, 0, HZ, lambda k: sample(k, -G * DOWN, (0.0, 0.0, 0.0)))
    blind = filter_.sigma_deg
    run(filter_, HZ, 1, lambda k: sample(k, -G * DOWN, SMALL_TURN))
    run(filter_, HZ + 1, 2 * HZ, lambda k: sample(k, -G * DOWN, (0.0, 0.0, 0.0)))
    assert blind > 5.0 and filter_.sigma_deg < 2.5


def orientation_of(falls: np.ndarray, yaw: float = 0.7) -> np.ndarray:
    """The quaternion of an IMU in which things fall this way, in a world with z up."""
    up = -falls
    x = np.cross(up, np.array([0.3, 0.5, 0.8]))
    x /= np.linalg.norm(x)
    R_world_imu = np.stack([x, np.cross(up, x), up])
    return quaternion_from_rotation(rotation_from_vector(np.array([0.0, 0.0, yaw])) @ R_world_imu)


def test_an_orientation_gives_roll_and_pitch_whatever_its_yaw() -> None:
    falls = tilted(25.0)
    for yaw in (0.0, 1.0, -2.5):
        filter_ = AttitudeFilter()
        said = orientation_of(falls, yaw)
        run(filter_, 0, HZ, lambda k, said=said: sample(k, None, SMALL_TURN, orientation=said))
        assert off_deg(filter_, falls) < 1e-3 and filter_.sigma_deg < 1.0


def test_an_orientation_whose_world_is_upside_down_gives_way_to_the_accelerometer() -> None:
    filter_ = AttitudeFilter()
    said = orientation_of(-DOWN)
    run(filter_, 0, HZ, lambda k: sample(k, -G * DOWN, SMALL_TURN, orientation=said))
    assert off_deg(filter_, DOWN) < 1e-3 and filter_.counts["orientation_disagrees"] == HZ


@pytest.mark.parametrize(
    ("acceleration", "reason"),
    [(None, "no_acceleration"), ((0, 0, 0), "no_acceleration"), ((0, 0, 1.0), "norm"), ((1e300, 1e300, 0), "norm")],
)
def test_an_accelerometer_that_gives_no_direction_is_counted(acceleration: object, reason: str) -> None:
    filter_ = AttitudeFilter()
    assert run(filter_, 0, 5, lambda k: sample(k, acceleration, SMALL_TURN)) == []
    assert filter_.counts == {reason: 5} and filter_.sigma_deg == 90.0


def test_a_gyroscope_that_gives_the_impossible_is_not_believed() -> None:
    filter_ = AttitudeFilter()
    run(filter_, 0, HZ, lambda k: sample(k, -G * DOWN, (1e8, 0.0, 1e300)))
    assert off_deg(filter_, DOWN) < 1e-6 and filter_.counts == {"turn": HZ}


def test_stamps_that_come_late_are_passed_over_and_a_clock_that_jumps_begins_anew() -> None:
    filter_ = AttitudeFilter()
    run(filter_, 0, HZ, lambda k: sample(k, -G * DOWN, SMALL_TURN))
    assert filter_.add_imu(sample(HZ - 3, G * DOWN, SMALL_TURN)) is None and off_deg(filter_, DOWN) < 1e-3
    assert filter_.add_imu(sample(HZ - 1, G * DOWN, SMALL_TURN)) is None
    output = filter_.add_imu(sample(-10 * HZ, -G * tilted(20.0), SMALL_TURN))
    assert output is not None and output.gravity == pytest.approx(tilted(20.0)) and output.gravity_sigma_deg > 3.0
    output = filter_.add_imu(sample(3600 * HZ, -G * tilted(40.0), SMALL_TURN))
    assert output is not None and output.gravity == pytest.approx(tilted(40.0))
    assert filter_.counts == {"late": 2, "time_jump": 1, "gap": 1}


def test_another_imu_on_the_topic_begins_anew() -> None:
    filter_ = AttitudeFilter()
    run(filter_, 0, HZ, lambda k: sample(k, -G * DOWN, SMALL_TURN, frame_id="a"))
    output = filter_.add_imu(sample(HZ, -G * tilted(90.0), SMALL_TURN, frame_id="b"))
    assert output is not None and output.gravity == pytest.approx(tilted(90.0)) and output.frame_id == "b"


def test_a_flood_gives_no_more_outputs_than_are_wanted() -> None:
    filter_ = AttitudeFilter()
    make = lambda k: sample(0, -G * DOWN, SMALL_TURN, stamp_ns=10**9 + k * 10_000)  # noqa: E731  100 kHz
    outputs = run(filter_, 0, 10_000, make)  # a tenth of a second
    assert len(outputs) == 1 + 99_990_000 // WORD_NS
    assert {len(value) for value in vars(filter_).values() if isinstance(value, list)} == set()


def test_any_sequence_of_finite_samples_keeps_a_direction_of_length_1() -> None:
    rng = np.random.default_rng(1)
    filter_ = AttitudeFilter()
    for _ in range(5000):
        scale = 10.0 ** rng.uniform(-12, 12)
        turn = rng.normal(0, 1, 3) * 10.0 ** rng.uniform(-12, 3) if rng.random() < 0.9 else None
        acceleration = rng.normal(0, 1, 3) * (scale if rng.random() < 0.5 else 7.0)
        output = filter_.add_imu(sample(0, acceleration, turn, stamp_ns=int(rng.integers(0, 4 * 10**9))))
        if output is not None:
            assert np.linalg.norm(output.gravity) == pytest.approx(1.0) and 0.0 < output.gravity_sigma_deg <= 90.0
