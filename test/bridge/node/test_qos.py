# SPDX-License-Identifier: Apache-2.0
"""Who receives whom, by the rules of DDS."""

from __future__ import annotations

import pytest
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSCompatibility,
    QoSProfile,
    ReliabilityPolicy,
    qos_check_compatible,
    qos_profile_sensor_data,
)

from objreg_ros.bridge.node import qos


def received(publisher: QoSProfile, subscriber: QoSProfile) -> bool:
    """Whether they match; that they leave their liveliness to the system is a warning and no more."""
    return qos_check_compatible(publisher, subscriber)[0] != QoSCompatibility.ERROR


def test_best_effort_receives_every_camera_and_reliable_only_reliable_ones() -> None:
    best_effort, reliable = qos.sensor(reliable=False), qos.sensor(reliable=True)
    for camera in (qos_profile_sensor_data, qos.stage()):
        assert received(camera, best_effort)
    assert received(qos.stage(), reliable) and not received(qos_profile_sensor_data, reliable)
    assert (best_effort.reliability, reliable.reliability) == (
        ReliabilityPolicy.BEST_EFFORT, ReliabilityPolicy.RELIABLE,
    )  # fmt: skip


@pytest.mark.parametrize("reliable", [True, False])
def test_a_camera_may_be_ten_messages_ahead(reliable: bool) -> None:
    profile = qos.sensor(reliable)
    assert (profile.history, profile.depth) == (HistoryPolicy.KEEP_LAST, 10)


def test_stages_lose_nothing_to_each_other_and_keep_nothing_for_those_who_come_late() -> None:
    profile = qos.stage()
    assert received(profile, profile) and not received(profile, qos.latched())
    assert profile.reliability == ReliabilityPolicy.RELIABLE and profile.durability != DurabilityPolicy.TRANSIENT_LOCAL
    assert profile.depth == 20


@pytest.mark.parametrize(("made", "depth"), [(qos.stage(7), 7), (qos.latched(), 1), (qos.latched(7), 7)])
def test_as_many_messages_are_kept_as_asked_for(made: QoSProfile, depth: int) -> None:
    assert (made.history, made.depth) == (HistoryPolicy.KEEP_LAST, depth)


def test_what_is_latched_reaches_those_who_come_late_and_those_who_do_not_care() -> None:
    assert received(qos.latched(), qos.latched()) and received(qos.latched(), qos.stage())
    assert qos.latched().durability == DurabilityPolicy.TRANSIENT_LOCAL
    assert qos.latched().reliability == ReliabilityPolicy.RELIABLE


def test_a_latched_profile_leaves_the_next_one_of_a_stage_alone() -> None:
    qos.latched()
    assert qos.stage().durability != DurabilityPolicy.TRANSIENT_LOCAL
