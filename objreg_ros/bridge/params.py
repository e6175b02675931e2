# SPDX-License-Identifier: Apache-2.0
"""The parameters that every node has."""

from __future__ import annotations

from dataclasses import dataclass

from objreg_ros.params import Params, param


@dataclass(frozen=True)
class DoorParams(Params):
    """How a node listens."""

    reliable: bool = param(
        False, "ask cameras and odometry for reliable delivery; a best-effort publisher then does not match"
    )
    silence: float = param(
        5.0, "an input that is silent, or of which everything is dropped, for this long is reported", unit="s", ge=0.1
    )
