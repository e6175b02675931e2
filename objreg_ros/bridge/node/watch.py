# SPDX-License-Identifier: Apache-2.0
"""Says which input of a node stays silent, and what to do about it. Knows no ROS."""

from __future__ import annotations

import time
from collections.abc import Callable

from objreg_ros.terminal import with_ros2cli

PERIOD_S = 5.0


class Watch:
    """The inputs that a node cannot work without. An input is one topic, or several of which one must speak.

    ``publishers`` counts the publishers of a topic by its full name.
    """

    def __init__(
        self, publishers: Callable[[str], int], period_s: float = PERIOD_S, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._publishers, self._period_s, self._clock = publishers, period_s, clock
        self._inputs: dict[str, dict[str, str]] = {}
        self._received_at: dict[str, float] = {}

    def expect(self, name: str, topics: dict[str, str]) -> None:
        """Watch the input ``name``: ``topics`` by their name in the code → their full name."""
        self._inputs[name] = topics
        self._received_at[name] = self._clock()

    def unwatch(self, name: str) -> None:
        """Watch the input no longer, if it was."""
        self._inputs.pop(name, None)
        self._received_at.pop(name, None)

    def note_input(self, name: str) -> None:
        """The input has spoken; of an input that is not watched too."""
        if name in self._received_at:
            self._received_at[name] = self._clock()

    def silent(self) -> dict[str, str]:
        """input → what is wrong and what to do, for each input that has been silent for a period."""
        now = self._clock()
        late = {name: now - received_at for name, received_at in self._received_at.items()}
        return {name: self._advice(name, seconds) for name, seconds in late.items() if seconds >= self._period_s}

    def _advice(self, name: str, seconds: float) -> str:
        topics = self._inputs[name]
        counts = {full: self._publishers(full) for full in topics.values()}
        heading = f"nothing on {' or '.join(topics.values())} for {seconds:.0f} s"
        if not any(counts.values()):
            remap = " or ".join(f"-r {relative}:=/your/topic" for relative in topics)
            look = with_ros2cli("see `ros2 topic list`, then remap", "see what the driver publishes, then remap")
            return f"{heading}: no publisher; {look} with --ros-args {remap}"
        alive = ", ".join(full for full, count in counts.items() if count)
        look = with_ros2cli(f"see `ros2 topic info -v {alive}`", "see docs/troubleshooting.md#waits-for-a-topic")
        return f"{heading}: {alive} has a publisher that is silent, or of another QoS: {look}"
