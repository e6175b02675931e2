# SPDX-License-Identifier: Apache-2.0
"""Robots by the namespaces of their nodes: what they are called, and what stands before their topics."""

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
