# SPDX-License-Identifier: Apache-2.0
"""The Fast DDS profile for big messages, unless the user has chosen one."""

from __future__ import annotations

import os
from collections.abc import MutableMapping

from objreg_ros.share import find

PROFILE = "config/fastdds.xml"
VARIABLES = ("FASTDDS_DEFAULT_PROFILES_FILE", "FASTRTPS_DEFAULT_PROFILES_FILE")  # since Fast DDS 2.13, and before
TRANSPORTS = "FASTDDS_BUILTIN_TRANSPORTS"


def apply(environment: MutableMapping[str, str] = os.environ) -> str:
    """Name our profile in ``environment`` before DDS reads it; a line for the log that says what is in force."""
    rmw = environment.get("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp")
    if "fastrtps" not in rmw:
        return f"{rmw}: check yourself that it carries messages of 10 MB"
    chosen = next((name for name in (*VARIABLES, TRANSPORTS) if environment.get(name)), None)
    if chosen and environment[chosen] != str(find(PROFILE)):
        return f"Fast DDS: your own {chosen}={environment[chosen]}"
    for name in VARIABLES:
        environment[name] = str(find(PROFILE))
    return f"Fast DDS: shared memory for big messages ({environment[VARIABLES[0]]})"
