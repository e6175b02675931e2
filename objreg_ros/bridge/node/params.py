# SPDX-License-Identifier: Apache-2.0
"""The parameters that every node has."""

from __future__ import annotations

from dataclasses import dataclass

from objreg_ros import limits
from objreg_ros.params import Params, param


@dataclass(frozen=True)
class NodeBaseParams(Params):
    """How a node listens."""

    reliable: bool = param(
        False, "ask cameras and odometry for reliable delivery; a best-effort publisher then does not match"
    )
    silence: float = param(
        5.0,
        "an input that is silent, or of which everything is dropped, for this long is reported; one that is silent may "
        "come by another of its topics",
        unit="s",
        ge=0.1,
    )
    max_megapixels: float = param(
        limits.MOST_PIXELS_OF_PICTURE * 1e-6,
        "a picture of more is refused before it is decoded",
        unit="megapixels",
        ge=0.01,
        le=limits.MOST_PIXELS * 1e-6,
    )

    @property
    def most_pixels(self) -> int:
        """`max_megapixels` as a number of pixels."""
        return round(1e6 * self.max_megapixels)


@dataclass(frozen=True)
class ManagedParams(Params):
    """Whether a node has a life cycle."""

    managed: bool = param(False, "be a managed (lifecycle) node: what is not live can then be set while unconfigured")
    autostart: bool = param(True, "configure and activate a managed node as it starts")
