# SPDX-License-Identifier: Apache-2.0
"""What a node of a running graph reports of itself in a status of `/diagnostics`."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from objreg_ros.bridge.node.accounting import Balance
from objreg_ros.bridge.node.common import FOUND

COUNTS = ("constraints", "stored keyframes", "stored objects", "stored landmarks", "waiting keyframes")
SILENT_S = 5.0  # a node that reported nothing for so long may have ended


@dataclass(frozen=True, slots=True)
class NodeReport:
    """The last status of a node: its counters, whether it warns and of what; what of its stream does not fit."""

    balance: Balance
    warns: bool
    message: str
    rejected: Mapping[str, int] = field(default_factory=dict)  # of a registrar: refusals by reason
    counts: Mapping[str, str] = field(default_factory=dict)  # of a registrar: those of COUNTS
    found: tuple[str, ...] = ()  # by anchor
    at_s: float = field(default_factory=time.monotonic)

    def is_silent(self) -> bool:
        """Whether the node should have reported again by now."""
        return time.monotonic() - self.at_s > SILENT_S


def report_of(status: Any) -> tuple[str, NodeReport] | None:
    """The name of a node and its report; None for a status that is not of this graph.

    ValueError or KeyError where counters are absent or no numbers.
    """
    from objreg_ros.bridge.node.diagnostics import REJECTED, balance_of

    if status.hardware_id != "objreg_ros":
        return None
    values = {pair.key: pair.value for pair in status.values}
    made = NodeReport(
        balance_of(status),
        status.level != b"\x00",
        status.message,
        {key.removeprefix(REJECTED): int(value) for key, value in values.items() if key.startswith(REJECTED)},
        {key: values[key] for key in COUNTS if key in values},
        tuple(sorted(key.removeprefix(FOUND) for key in values if key.startswith(FOUND))),
    )
    return status.name.removesuffix(": frames"), made
