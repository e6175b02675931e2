# SPDX-License-Identifier: Apache-2.0
"""The direction of gravity from an IMU: the gyroscope carries the direction on, the accelerometer puts it right.

A Kalman filter (Kalman, 1960) on the direction of gravity in the IMU's own axes and on the gyroscope's bias, with one
covariance for all tilts. It is the passive complementary filter of Mahony, Hamel and Pflimlin, "Nonlinear complementary
filters on the special orthogonal group" (2008), with gains that follow from how sure each side is.
"""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

from objreg_ros.data.frames import JUMP_NS, FeltGravity, ImuSample

G = 9.80665  # m/s^2
NORM_SLACK = 0.15  # m/s^2 off G that the scale of a cheap accelerometer explains
STEADY_DEG = 3.0  # the error of an accelerometer in a hand at the right norm: a push from the side hardly changes it
ORIENTATION_DEG = 1.0  # the error of an orientation that has no covariance, or a smaller one
CORRELATION_S = 0.5  # for which the errors of both last: a thousand samples within it are as good as one
TURN_DEG = 0.1  # per root second: how a gyroscope's direction wanders
SCALE = 0.01  # share of a gyroscope's turn that is wrong
GYRO_BIAS_DEG = 1.0  # per second: the bias of a gyroscope that nobody calibrated
GYRO_WALK_DEG = 0.01  # per second and root second: how that wanders
MOST_GYRO_BIAS_DEG = 5.0  # per second; more is no bias
BLIND_TURN_DEG = 30.0  # per root second: how a camera in a hand turns, where no gyroscope measures it
BIAS_DEG = 0.5  # tilt by the accelerometer's bias, which no filter removes
LEAST_NORM, MOST_NORM = 0.5 * G, 2.0 * G  # beyond, an accelerometer measures a fall or a blow, and gives no direction
MOST_TURN = 70.0  # rad/s: twice what gyroscopes measure
ORIENTATION_OFF_DEG = 20.0  # from a steady accelerometer's direction: the orientation is of a frame whose z is not up
GAP_NS = 500_000_000  # without a sample for longer the direction begins anew
WORD_NS = 8_000_000  # between two outputs: a direction every 10 ms is enough for interpolation
MOST_DEG = 90.0  # a standard deviation of more says no more

Vector = tuple[float, float, float]
Measured = tuple[Vector, float]  # a direction of length 1, and its deviation in radians


class AttitudeFilter:
    """The direction of gravity after every sample of one IMU; cheap enough for a thousand samples a second.

    ``counts`` has, by reason, what was passed over: ``late`` (a stamp that is not after the last), ``time_jump`` and
    ``gap`` (the filter began anew there), ``no_acceleration`` and ``norm`` (nothing gave a direction), ``turn`` (faster
    than any gyroscope measures), ``orientation_disagrees`` (with a steady accelerometer).
    """

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self._falls: Vector | None = None  # of length 1, in the IMU's axes
        self._variance = 0.0  # rad^2, of each tilt
        self._bias: Vector = (0.0, 0.0, 0.0)  # of the gyroscope, in rad/s
        self._bias_variance = math.radians(GYRO_BIAS_DEG) ** 2
        self._covariance = 0.0  # of tilt and bias
        self._last_ns = 0
        self._passed_s = 0.0  # between the last two samples
        self._output_ns: int | None = None
        self._frame_id = ""
        self._has_turned = False  # whether the gyroscope ever gave more than zeros, which stand for none too

    def add_imu(self, sample: ImuSample) -> FeltGravity | None:
        """Take a sample in; the direction at its stamp, at most one every 8 ms, and None where none is due or known."""
        if not self._go(sample):
            return None
        self._correct(sample)
        if self._falls is None or (self._output_ns is not None and sample.stamp_ns - self._output_ns < WORD_NS):
            return None
        self._output_ns = sample.stamp_ns
        return FeltGravity(
            gravity=np.array(self._falls),
            gravity_sigma_deg=self.sigma_deg,
            stamp_ns=sample.stamp_ns,
            frame_id=sample.frame_id,
        )

    @property
    def sigma_deg(self) -> float:
        """The standard deviation of each tilt in degrees; 90 where nothing is known."""
        if self._falls is None:
            return MOST_DEG
        return min(MOST_DEG, math.hypot(math.degrees(math.sqrt(self._variance)), BIAS_DEG))

    def _go(self, sample: ImuSample) -> bool:
        """Carry the direction on to a sample; False for one that comes late."""
        passed_ns = sample.stamp_ns - self._last_ns
        if self._falls is not None:
            same = sample.frame_id == self._frame_id
            if same and -JUMP_NS < passed_ns <= 0:
                self.counts["late"] += 1
                return False
            if not same or not 0 < passed_ns <= GAP_NS:
                self._begin_anew("gap" if passed_ns > 0 else "time_jump")
        turn = self._turn(sample)
        if self._falls is not None:
            self._carry(self._falls, turn, 1e-9 * passed_ns)
        self._last_ns, self._frame_id = sample.stamp_ns, sample.frame_id
        return True

    def _begin_anew(self, why: str) -> None:
        self.counts[why] += 1
        self._falls, self._output_ns, self._covariance = None, None, 0.0

    def _turn(self, sample: ImuSample) -> Vector | None:
        """The gyroscope's angular velocity in rad/s; None without one."""
        if sample.angular_velocity is None:
            return None
        turn = x, y, z = sample.angular_velocity.tolist()
        if math.hypot(x, y, z) > MOST_TURN:
            self.counts["turn"] += 1
            return None
        self._has_turned = self._has_turned or turn != [0.0, 0.0, 0.0]
        return (x, y, z) if self._has_turned else None

    def _carry(self, falls: Vector, turn: Vector | None, seconds: float) -> None:
        """Carry on by a time: what stands still turns in the opposite direction in the IMU's axes."""
        if turn is None:
            self._falls, self._covariance = falls, 0.0
            self._variance += math.radians(BLIND_TURN_DEG) ** 2 * seconds
        else:
            true = turn[0] - self._bias[0], turn[1] - self._bias[1], turn[2] - self._bias[2]
            self._falls = _turned(falls, true, -seconds)
            wander = math.radians(TURN_DEG) ** 2 + (SCALE * math.hypot(*true)) ** 2 * CORRELATION_S
            self._variance += seconds * (wander + 2.0 * self._covariance + seconds * self._bias_variance)
            self._covariance += seconds * self._bias_variance
            self._bias_variance += math.radians(GYRO_WALK_DEG) ** 2 * seconds
        if self._variance > math.radians(MOST_DEG) ** 2:
            self._variance, self._covariance = math.radians(MOST_DEG) ** 2, 0.0
        self._passed_s = seconds

    def _correct(self, sample: ImuSample) -> None:
        """Turn the direction towards that of the sample, and correct the bias, by how much surer the sample is."""
        measured = self._measured(sample)
        if measured is None:
            return
        direction, sigma = measured
        if self._falls is None:
            self._falls, self._variance = direction, sigma * sigma
            return
        total = self._variance + sigma * sigma * CORRELATION_S / self._passed_s
        gain, bias_gain = self._variance / total, self._covariance / total
        off = _turn_between(self._falls, direction)
        self._falls = _turned(self._falls, off, gain)
        self._bias = _bounded(
            (self._bias[0] + bias_gain * off[0], self._bias[1] + bias_gain * off[1], self._bias[2] + bias_gain * off[2])
        )
        self._bias_variance -= bias_gain * self._covariance
        self._covariance *= 1.0 - gain
        self._variance *= 1.0 - gain

    def _measured(self, sample: ImuSample) -> Measured | None:
        """The direction by the orientation, else by the accelerometer, with its deviation in radians."""
        felt, oriented = self._felt(sample), _oriented(sample)
        if felt is not None and oriented is not None:
            off = math.degrees(_angle(felt[0], oriented[0]))
            if off > ORIENTATION_OFF_DEG and math.degrees(felt[1]) < 2.0 * STEADY_DEG:
                self.counts["orientation_disagrees"] += 1
                return felt
        if felt is None and oriented is None:
            self.counts["norm" if _is_felt(sample) else "no_acceleration"] += 1
        return oriented or felt

    def _felt(self, sample: ImuSample) -> Measured | None:
        """The direction against an acceleration, the less sure the more its norm differs from that of gravity.

        A norm of g + e is that of a push at a right angle by acos(g / (g + e)).
        """
        if sample.acceleration is None:
            return None
        x, y, z = sample.acceleration.tolist()
        norm = math.hypot(x, y, z)
        if not LEAST_NORM <= norm <= MOST_NORM:
            return None
        excess = max(0.0, abs(norm - G) - NORM_SLACK)
        return (-x / norm, -y / norm, -z / norm), math.hypot(math.radians(STEADY_DEG), math.acos(G / (G + excess)))


def _is_felt(sample: ImuSample) -> bool:
    return sample.acceleration is not None and bool(sample.acceleration.any())


def _oriented(sample: ImuSample) -> Measured | None:
    """The direction by an orientation in a frame with z up."""
    if sample.orientation is None:
        return None
    x, y, z, w = sample.orientation.tolist()
    falls = -2.0 * (x * z - y * w), -2.0 * (y * z + x * w), 2.0 * (x * x + y * y) - 1.0
    return falls, math.radians(max(ORIENTATION_DEG, sample.orientation_sigma_deg))


def _turned(v: Vector, rate: Vector, seconds: float) -> Vector:
    """A direction turned about an axis by its length in rad/s (Rodrigues), of length 1 again."""
    speed = math.hypot(*rate)
    if speed == 0.0:
        return v
    a, b, c = (r / speed for r in rate)
    x, y, z = v
    sine, cosine = math.sin(speed * seconds), math.cos(speed * seconds)
    along = (1.0 - cosine) * (a * x + b * y + c * z)
    return _unit(
        x * cosine + (b * z - c * y) * sine + a * along,
        y * cosine + (c * x - a * z) * sine + b * along,
        z * cosine + (a * y - b * x) * sine + c * along,
    )


def _turn_between(a: Vector, b: Vector) -> Vector:
    """The rotation vector in radians that turns one direction into another by the smallest angle."""
    x, y, z = _cross(a, b)
    sine = math.hypot(x, y, z)
    if sine < 1e-9:
        axis = _unit(*_cross(a, (1.0, 0.0, 0.0) if abs(a[0]) < 0.7 else (0.0, 1.0, 0.0)))  # half a turn, or none
        angle = _angle(a, b)
        return angle * axis[0], angle * axis[1], angle * axis[2]
    scale = _angle(a, b) / sine
    return scale * x, scale * y, scale * z


def _bounded(bias: Vector) -> Vector:
    size, most = math.hypot(*bias), math.radians(MOST_GYRO_BIAS_DEG)
    return bias if size <= most else (bias[0] * most / size, bias[1] * most / size, bias[2] * most / size)


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _angle(a: Vector, b: Vector) -> float:
    return math.atan2(math.hypot(*_cross(a, b)), a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def _unit(x: float, y: float, z: float) -> Vector:
    norm = math.hypot(x, y, z)
    return x / norm, y / norm, z / norm
