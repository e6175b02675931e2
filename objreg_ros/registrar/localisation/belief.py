# SPDX-License-Identifier: Apache-2.0
"""The odds that a camera is elsewhere than odometry says, by Bayes' rule.

Before anything is seen, a camera is taken away at a known rate. What is seen then multiplies the odds by how much
likelier it is of a camera that is elsewhere than of one that is where odometry says.
"""

from __future__ import annotations

import math

RATE_HZ = 1.0 / 3600.0  # a camera that runs is taken elsewhere, or its odometry fails, once an hour
WAITED = 0.02  # probability of that with nothing seen, however long: some minute's worth
MOST = math.log(1e6)  # the log odds are kept within: no evidence is free of common causes


class Belief:
    """The probability of being elsewhere, at the stamp that it was asked to wait for last."""

    def __init__(self) -> None:
        self._stamp_ns: int | None = None
        self._log_odds = -MOST

    @property
    def odds(self) -> float:
        """That the camera is elsewhere, to 1 that it is where odometry says."""
        return math.exp(self._log_odds)

    @property
    def probability(self) -> float:
        """Of being elsewhere, 0 to 1."""
        return self.odds / (1.0 + self.odds)

    def wait(self, stamp_ns: int) -> None:
        """Go on to a later stamp; an earlier one is passed over. Waiting alone makes it no likelier than `WAITED`."""
        before_ns, self._stamp_ns = self._stamp_ns, max(stamp_ns, self._stamp_ns or stamp_ns)
        if before_ns is None or stamp_ns <= before_ns or self.probability >= WAITED:
            return
        stays = math.exp(-RATE_HZ * 1e-9 * (stamp_ns - before_ns))
        elsewhere = min(1.0 - (1.0 - self.probability) * stays, WAITED)
        self._set(math.log(elsewhere / (1.0 - elsewhere)))

    def weigh(self, log_ratio: float, most: float = math.inf) -> None:
        """Take in evidence: the log of how much likelier it is of a camera elsewhere than of one that is here.

        It raises the odds to ``most`` at most.
        """
        if log_ratio > 0.0:
            log_ratio = min(log_ratio, max(math.log(most) - self._log_odds, 0.0))
        self._set(self._log_odds + log_ratio)

    def settle(self, odds: float) -> None:
        """Begin anew, with these odds that the camera is where odometry says now."""
        self._set(-math.log(max(odds, 1.0)))

    def _set(self, log_odds: float) -> None:
        self._log_odds = min(max(log_odds, -MOST), MOST)
