# SPDX-License-Identifier: Apache-2.0
"""Messages that were sent and did not come, by the numbers that their publisher gives them."""

from __future__ import annotations


class Missed:
    """Follows the numbers of one publisher."""

    def __init__(self) -> None:
        self._last: int | None = None

    def before(self, number: int | None) -> int:
        """How many are missing between the message before and this one; 0 for the first, and after a restart.

        None (a middleware that does not number) says nothing.
        """
        last, self._last = self._last, number
        return max(0, number - last - 1) if number is not None and last is not None else 0
