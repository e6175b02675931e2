# SPDX-License-Identifier: Apache-2.0
"""What makes a file: a refusal of a chosen kind, an accepted closure with weak odds, a lost camera, or a call."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from objreg_ros.data.localisation import State

CALLED, WEAK, LOST = "called", "weak_odds", "lost"
LOST_STATES = (State.LOST.name, State.KIDNAPPED.name)


@dataclass(frozen=True, slots=True)
class Event:
    """What happened, in one word (the reason of a refusal, or one of the above); its text, and its two keyframes."""

    what: str
    detail: str = ""
    from_ns: int | None = None
    to_ns: int | None = None


def of_refusal(reason: str, detail: str, from_ns: int, to_ns: int, wanted: Collection[str]) -> Event | None:
    """The event of a refusal; None for one of a kind that is not ``wanted``."""
    return Event(reason, detail, from_ns, to_ns) if reason in wanted else None


def of_closure(from_ns: int, to_ns: int, evidence: Mapping[str, float], least_odds: float) -> Event | None:
    """The event of an accepted closure; None for one with odds of at least ``least_odds``, or that says none."""
    odds = evidence.get("odds")
    if odds is None or odds >= least_odds:
        return None
    return Event(WEAK, f"odds of {odds:.4g}, expected {least_odds:.4g}", from_ns, to_ns)


def of_state(state: str, before: str, detail: str = "") -> Event | None:
    """The event of a state of localisation that has just become lost; None for any other."""
    now_lost, was_lost = (text.strip().upper() in LOST_STATES for text in (state, before))
    return Event(LOST, f"{state}: {detail}".removesuffix(": ")) if now_lost and not was_lost else None


class Rest:
    """Lets one event pass in so many seconds of the stream: the others are in its file, or in the next one."""

    def __init__(self, seconds: float) -> None:
        self._rest_ns = round(1e9 * seconds)
        self._last_ns: int | None = None

    def passes(self, clock_ns: int) -> bool:
        """Whether a file is written now; from then on it rests. A clock that went back begins anew."""
        rested = self._last_ns is None or not 0 <= clock_ns - self._last_ns < self._rest_ns
        if rested:
            self._last_ns = clock_ns
        return rested
