# SPDX-License-Identifier: Apache-2.0
"""Robots by the namespaces of their nodes: what they are called, what stands before their topics and their frames."""

from __future__ import annotations

from collections.abc import Sequence

from rclpy.node import Node


def prefixes_of(node: Node, robots: Sequence[str]) -> dict[str, str]:
    """By the name of each robot what stands before its topics; one without a name and a prefix where there are none.

    A robot is called by its whole namespace, as it calls itself.
    """
    return {_name_of(node, robot): f"{robot}/" if robot else "" for robot in robots} or {"": ""}


def _name_of(node: Node, robot: str) -> str:
    topic = f"{robot}/odom" if robot else "odom"
    return node.resolve_topic_name(topic, only_expand=True).removesuffix("/odom").strip("/")


def framed(robot: str, frame_id: str) -> str:
    """A frame under the prefix of its robot, which it may have already."""
    return frame_id if not robot or frame_id.startswith(f"{robot}/") else f"{robot}/{frame_id}"


def unframed(robot: str, frame_id: str) -> str:
    """A frame without the prefix of its robot."""
    return frame_id.removeprefix(f"{robot}/") if robot else frame_id


def robot_of(frame_id: str, robots: Sequence[str]) -> str:
    """The robot whose prefix a frame has, the longest name first; empty for none."""
    return next((robot for robot in sorted(robots, key=len, reverse=True) if frame_id.startswith(f"{robot}/")), "")
