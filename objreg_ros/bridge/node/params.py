# SPDX-License-Identifier: Apache-2.0
"""The parameters that every node has, and those of what only the border knows."""

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


@dataclass(frozen=True)
class RelocalisedParams(Params):
    """How the registrar publishes its pose in the map of an earlier session."""

    map_frame: str = param(
        "earlier_map", "name of the frame of an earlier session's map, in which `relocalised` is; for Nav2: map"
    )
    initialpose: bool = param(False, "publish the pose on `initialpose` too, projected to the plane, as AMCL takes it")


@dataclass(frozen=True)
class PeerParams(Params):
    """What peers may ask of a registrar."""

    allow_remote_reset: bool = param(
        False,
        "whether ~/reset, which any peer can call, may put a store that is a file aside and begin an empty one",
        at_start=True,
    )


@dataclass(frozen=True)
class KeyParams(Params):
    """What proves that a message is of one of us."""

    key_file: str = param(
        "",
        "file with a key of 16 to 4096 bytes that all robots share, read at the start: keyframes, summaries and "
        "requests are signed with it, and others are not read; empty: no signatures",
        at_start=True,
    )


@dataclass(frozen=True)
class ExchangeParams(Params):
    """How registrars that each keep their own store close loops between their robots."""

    exchange: str = param(
        "", "namespace of the topics by which registrars of several robots exchange keyframes, as /fleet; empty: none"
    )
    exchange_kilobytes: float = param(150.0, "most that is sent to the others, on average", "kB/s", ge=0.1)
