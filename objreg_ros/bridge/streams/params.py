# SPDX-License-Identifier: Apache-2.0
"""The parameters of what nodes exchange: keys, other registrars, relocalisation."""

from __future__ import annotations

from dataclasses import dataclass

from objreg_ros.params import Params, param


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
