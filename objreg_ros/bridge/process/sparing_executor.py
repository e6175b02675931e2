# SPDX-License-Identifier: Apache-2.0
"""An executor that seldom looks at what seldom happens."""

from __future__ import annotations

import time
from typing import Any

from rclpy.event_handler import EventHandler
from rclpy.executors import SingleThreadedExecutor

LOOK_S = 0.2  # between two looks at the events of DDS, while messages come


class SparingExecutor(SingleThreadedExecutor):
    """rclpy's executor. It looks for the events of DDS (who is connected, whose QoS does not fit) every `LOOK_S` only.

    rclpy goes through everything that a node waits for with every message, and each topic has two or three events: that
    is half of its work. DDS keeps an event until it is taken. Where nothing else comes the next timer, at the latest
    that of the diagnostics, has its turn first.
    """

    def __init__(self, **named: Any) -> None:
        super().__init__(**named)
        self._looks, self._has_looked, self._due = True, False, 0.0

    def can_execute(self, entity: Any) -> bool:
        """As rclpy, and no event of DDS before it is time to look."""
        if isinstance(entity, EventHandler):
            if not self._looks:
                return False
            self._has_looked = True
        return bool(super().can_execute(entity))

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """As rclpy."""
        self._begin_round()
        super().spin_once(timeout_sec)

    def _begin_round(self) -> None:
        """Whether it is time to look."""
        now = time.monotonic()
        if self._has_looked:
            self._has_looked, self._due = False, now + LOOK_S
        self._looks = now >= self._due
