# SPDX-License-Identifier: Apache-2.0
"""Memory that is free, but that the allocator keeps for later."""

from __future__ import annotations

import ctypes
from contextlib import suppress


def give_back() -> None:
    """Let the GNU C library give whole free pages back to the system, in a millisecond. Elsewhere nothing happens.

    What a solution takes and frees is of all sizes, and comes to as much as what is in use. To take it anew costs time,
    so this is not for every solution.
    """
    with suppress(AttributeError, OSError):
        ctypes.CDLL(None).malloc_trim(0)
