# SPDX-License-Identifier: Apache-2.0
"""The parameters of other nodes, as they are now, and the versions of what runs here."""

from __future__ import annotations

import platform
import time
from collections.abc import Iterable, Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python

ANSWER_S = 2.0  # most that a node has to answer in
PACKAGES = ("objreg_ros", "numpy", "onnxruntime", "opencv-python-headless", "rclpy")
LEFT_OUT = ("qos_overrides.", "start_type_description_service", "key_file")  # what changes no verdict, and keys


class ParameterReader:
    """Asks nodes of the same namespace. For a thread other than the executor's, which has to spin."""

    def __init__(self, node: Node, others: Sequence[str]) -> None:
        group = ReentrantCallbackGroup()
        self._clients = {
            other: (
                node.create_client(ListParameters, f"{other}/list_parameters", callback_group=group),
                node.create_client(GetParameters, f"{other}/get_parameters", callback_group=group),
            )
            for other in others
        }

    def read(self) -> dict[str, dict[str, Any]]:
        """Name → value of each node that answers within `ANSWER_S`; nothing of one that does not."""
        deadline = time.monotonic() + ANSWER_S
        return {other: values for other in self._clients if (values := self._of(other, deadline))}

    def _of(self, other: str, deadline: float) -> dict[str, Any]:
        listing, getting = self._clients[other]
        if not (listing.service_is_ready() and getting.service_is_ready()):
            return {}
        listed = _wait(listing.call_async(ListParameters.Request()), deadline)
        names = [] if listed is None else _wanted(listed.result.names)
        got = _wait(getting.call_async(GetParameters.Request(names=names)), deadline) if names else None
        return {} if got is None else values_of(names, got.values)

    @staticmethod
    def versions() -> dict[str, str]:
        """The versions of Python, of this package and of the libraries that decide with it."""
        found = {"python": platform.python_version()}
        for package in PACKAGES:
            try:
                found[package] = version(package)
            except PackageNotFoundError:  # of a workspace, or of Ubuntu under another name
                continue
        return found


def values_of(names: Iterable[str], values: Iterable[ParameterValue]) -> dict[str, Any]:
    """Name → value, lists as lists, and without those that are not set."""
    pairs = ((name, parameter_value_to_python(value)) for name, value in zip(names, values, strict=False))
    return {name: value if isinstance(value, bool | int | float | str) else list(value)
            for name, value in pairs if value is not None}  # fmt: skip


def _wanted(names: Iterable[str]) -> list[str]:
    return sorted(name for name in names if not name.startswith(LEFT_OUT))


def _wait(future: Any, deadline: float) -> Any:
    """What a call gives; None where it gives nothing in time."""
    while not future.done() and time.monotonic() < deadline:
        time.sleep(0.01)
    return future.result() if future.done() else None
