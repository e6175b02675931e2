# SPDX-License-Identifier: Apache-2.0
"""The Fast DDS profile for big messages, unless the user has chosen one: his own, or ours for Wi-Fi."""

from __future__ import annotations

import os
from collections.abc import MutableMapping
from pathlib import Path

from objreg_ros.share import find

PROFILE = "config/fastdds.xml"
NODE = "config/fastdds_node.xml"  # of a process that sends no images and no clouds of a camera
WIFI = "config/fastdds_wifi.xml"
VARIABLES = ("FASTDDS_DEFAULT_PROFILES_FILE", "FASTRTPS_DEFAULT_PROFILES_FILE")  # since Fast DDS 3, and before
TRANSPORTS = "FASTDDS_BUILTIN_TRANSPORTS"
MODE = "RMW_FASTRTPS_PUBLICATION_MODE"


def apply(environment: MutableMapping[str, str] = os.environ, ours: str = PROFILE) -> str:
    """Name our profile in ``environment`` before DDS reads it; a line for the log that says what is in force.

    ``ours`` is the one of this process, which takes the place of that of the process that started it.
    """
    rmw = environment.get("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp")
    if "fastrtps" not in rmw:
        return f"{rmw}: check yourself that it carries messages of 10 MB"
    chosen = next((name for name in (*VARIABLES, TRANSPORTS) if environment.get(name)), None)
    if chosen and _is(environment[chosen], WIFI):
        environment[MODE] = "AUTO"  # that of the profile: its flow controller takes no synchronous writer
        return f"Fast DDS: small datagrams at 4 Mbit/s for Wi-Fi ({_name(environment, WIFI)})"
    if chosen and not any(_is(environment[chosen], one) for one in (PROFILE, NODE)):
        return f"Fast DDS: your own {chosen}={environment[chosen]}"
    return f"Fast DDS: shared memory for big messages ({_name(environment, ours)})"


def _is(chosen: str, profile: str) -> bool:
    return Path(chosen).resolve() == find(profile).resolve()


def _name(environment: MutableMapping[str, str], profile: str) -> str:
    for name in VARIABLES:
        environment[name] = str(find(profile))
    return environment[VARIABLES[0]]
