# SPDX-License-Identifier: Apache-2.0
"""The log of a node, in which the text of others cannot pass for a line of its own, nor for a command to a terminal."""

from __future__ import annotations

from typing import Any

from rclpy.impl.rcutils_logger import RcutilsLogger

from objreg_ros.terminal import printable

CONTINUED = "\n    "


class PlainLog(RcutilsLogger):
    """rclpy's logger of the same name, of printable text; its lines behind the first are indented.

    A method for each severity, since rclpy takes the line that calls it for the place of a message, of one severity.
    """

    def debug(self, message: Any, **options: Any) -> Any:
        """As rclpy's."""
        return super().debug(_plain(message), **options)

    def info(self, message: Any, **options: Any) -> Any:
        """As rclpy's."""
        return super().info(_plain(message), **options)

    def warning(self, message: Any, **options: Any) -> Any:
        """As rclpy's."""
        return super().warning(_plain(message), **options)

    def error(self, message: Any, **options: Any) -> Any:
        """As rclpy's."""
        return super().error(_plain(message), **options)

    def fatal(self, message: Any, **options: Any) -> Any:
        """As rclpy's."""
        return super().fatal(_plain(message), **options)


def _plain(message: Any) -> str:
    return printable(str(message)).rstrip("\n").replace("\n", CONTINUED)
