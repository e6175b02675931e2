# SPDX-License-Identifier: Apache-2.0
"""The odds that a camera is elsewhere than odometry says, by Bayes' rule.

Before anything is seen, a camera is taken away at a known rate. What is seen then multiplies the odds by how much
likelier it is of a camera that is elsewhere than of one that is where odometry says.
"""

from __future__ import annotations

import math

RATE_HZ = 1.0 / 3600.0  # a camera that runs is taken elsewhere, or its odometry fails, once an hour
MOST = math.log(1e6)  # the log odds are kept within: no evidence is free of common causes


class Belief:
    """The probability of being elsewhere, at a stamp."""

    def __init__(self, stamp_ns: int) -> None:
        self._stamp_ns, self._log_odds = stamp_ns, -MOST

    @property
    def odds(self) -> float:
        """That the camera is elsewhere, to 1 that it is where odometry says."""
        return math.exp(self._log_odds)

    @property
    def probability(self) -> float:
        """Of being elsewhere, 0 to 1."""
        return self.odds / (1.0 + self.odds)

    def wait(self, stamp_ns: int) -> None:
        """Go on to a later stamp; an earlier one is passed over."""
        if stamp_ns <= self._stamp_ns:
            return
        stays = math.exp(-RATE_HZ * 1e-9 * (stamp_ns - self._stamp_ns))
        self._stamp_ns, here = stamp_ns, (1.0 - self.probability) * stays
        self._set(math.log((1.0 - here) / here))

    def weigh(self, log_ratio: float) -> None:
        """Take in evidence: the log of how much likelier it is of a camera elsewhere than of one that is here."""
        self._set(self._log_odds + log_ratio)

    def settle(self, odds: float) -> None:
        """Begin anew, with these odds that the camera is where odometry says now."""
        self._set(-math.log(max(odds, 1.0)))

    def _set(self, log_odds: float) -> None:
        self._log_odds = min(max(log_odds, -MOST), MOST)
