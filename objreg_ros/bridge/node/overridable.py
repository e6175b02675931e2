# SPDX-License-Identifier: Apache-2.0
"""A node of which every topic's QoS can be changed by parameters, as in rclcpp.

``qos_overrides./image.subscription.reliability`` (or ``.publisher``; ``history``, ``depth``, ``reliability``) holds
for a topic by its full name, after remapping. rclpy leaves it to every single topic to ask for that.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from typing import Any

from rclpy.exceptions import ParameterException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import InvalidQosOverridesError, QosCallbackResult, QoSOverridingOptions
from rclpy.subscription import Subscription

from objreg_ros.bridge.node.plain_log import PlainLog

MADE_FIRST = "/parameter_events"  # rclpy publishes it before a node can have parameters
FIXED = QoSOverridingOptions(())  # of a topic whose QoS is what it is opened for


class QuietPublisher(Publisher):
    """A publisher that has no reader and publishes nothing once ROS is shut down: a signal comes between any two steps.

    ``is_up`` says whether ROS still runs.
    """

    is_up: Callable[[], bool]

    def publish(self, msg: Any) -> None:
        """As rclpy's."""
        try:
            super().publish(msg)
        except rclpy_implementation.RCLError:
            if self.is_up():
                raise

    def get_subscription_count(self) -> int:
        """As rclpy's."""
        try:
            return super().get_subscription_count()
        except rclpy_implementation.RCLError:
            if self.is_up():
                raise
            return 0


class OverridableNode(Node):
    """ValueError where a topic is opened with an override that is no QoS. Its log is plain text."""

    _plain_log: PlainLog | None = None

    def get_logger(self) -> PlainLog:
        """As rclpy's, of printable text."""
        if self._plain_log is None:
            self._plain_log = PlainLog(super().get_logger().name)
        return self._plain_log

    def create_publisher(self, msg_type: Any, topic: str, qos_profile: QoSProfile | int, **options: Any) -> Publisher:
        """As rclpy's, with overrides; quiet once ROS is shut down."""
        if topic == MADE_FIRST:
            return super().create_publisher(msg_type, topic, qos_profile, **options)
        options.setdefault("publisher_class", QuietPublisher)
        made = _overridden(super().create_publisher, msg_type, topic, qos_profile, options)
        made.is_up = self.context.ok
        return made

    def create_subscription(
        self, msg_type: Any, topic: str, callback: Callable[[Any], None], qos_profile: QoSProfile | int, **options: Any
    ) -> Subscription:
        """As rclpy's, with overrides."""

        def create(kind: Any, name: str, profile: QoSProfile | int, **more: Any) -> Subscription:
            return Node.create_subscription(self, kind, name, callback, profile, **more)

        return _overridden(create, msg_type, topic, qos_profile, options)


def _overridden(
    create: Callable[..., Any], kind: Any, topic: str, profile: QoSProfile | int, options: dict[str, Any]
) -> Any:
    options.setdefault("qos_overriding_options", QoSOverridingOptions.with_default_policies(callback=_judge))
    try:
        return create(kind, topic, copy(profile), **options)  # rclpy writes overrides into the profile
    except (ParameterException, InvalidQosOverridesError) as error:
        raise ValueError(f"qos_overrides of {topic}: {error}") from error
    except RuntimeError as error:
        if "QoS override" not in str(error):
            raise
        raise ValueError(f"qos_overrides of {topic}: {error}") from error


def _judge(profile: QoSProfile) -> QosCallbackResult:
    """Refuse what rclpy takes and DDS does not."""
    known = profile.history != HistoryPolicy.UNKNOWN and profile.reliability != ReliabilityPolicy.UNKNOWN
    if known and profile.depth >= 0:
        return QosCallbackResult(successful=True)
    got = f"{profile.history.name}, {profile.reliability.name} and {profile.depth}".lower()
    return QosCallbackResult(
        successful=False, reason=f"expected a known history and reliability and a depth of 0 or more, got {got}"
    )
