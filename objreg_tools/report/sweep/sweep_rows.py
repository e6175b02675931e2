# SPDX-License-Identifier: Apache-2.0
"""What each combination of a sweep found, and which of them is best.

A false constraint costs more than any that is missed. So the best has the fewest false ones, of these the most revisits
closed, and of these the fewest values that are not the defaults. Without truth nothing says which is best.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class Found:
    """What a run with some combination found in one recording; one that failed has an ``error`` and no counts."""

    name: str
    recording: str
    file: str = ""  # of its JSON, in the folder of the sweep
    error: str = ""
    frames: int = 0
    constraints: int = 0
    judged: int = 0  # constraints that a truth covers
    loose: int = 0  # of these within 5 degrees and 10 cm
    false: int = 0  # of these off by more than 8 degrees or 15 cm
    revisits: int = 0  # by truth
    closed: int = 0  # of these
    odds: tuple[float, ...] = ()
    seconds: float = 0.0


@dataclass(frozen=True, slots=True)
class Setting:
    """A combination with what it found in all recordings. ``changed`` counts the values that are not the defaults."""

    values: Mapping[str, Any]
    changes: tuple[str, ...]  # as `--set` takes them
    changed: int = 0
    found: Sequence[Found] = field(default_factory=tuple)

    def total(self, count: str) -> int:
        """A count over all recordings."""
        return sum(getattr(one, count) for one in self.found)

    @property
    def failed(self) -> int:
        """How many recordings failed."""
        return sum(bool(one.error) for one in self.found)

    @property
    def recall(self) -> float | None:
        """The share 0..1 of the revisits that were closed; None where truth knows of none."""
        revisits = self.total("revisits")
        return self.total("closed") / revisits if revisits else None

    @property
    def odds(self) -> list[float]:
        """The odds of all constraints, the largest first."""
        return sorted((odds for one in self.found for odds in one.odds), reverse=True)

    @property
    def text(self) -> str:
        """``least_odds 20, threshold 0.3``: the names without their nodes."""
        return ", ".join(f"{name.partition('.')[2]} {shown(value)}" for name, value in self.values.items())


def shown(value: Any) -> str:
    """A value of a parameter as text."""
    if isinstance(value, float):
        return f"{value:g}"
    return " ".join(map(str, value)) if isinstance(value, tuple | list) else str(value)


def is_judged(settings: Sequence[Setting]) -> bool:
    """Whether truth can say which is best: it knows of revisits."""
    return any(setting.total("revisits") for setting in settings)


def ranked(settings: Sequence[Setting]) -> list[Setting]:
    """The best first; those with failures last. Without truth in the order in which they came."""
    if not is_judged(settings):
        return list(settings)
    return sorted(settings, key=lambda one: (*_rank(one), one.changed))


def best_of(settings: Sequence[Setting]) -> Setting | None:
    """The best; None where no truth can say, or all failed somewhere."""
    first = ranked(settings)[0] if is_judged(settings) else None
    return None if first is None or first.failed else first


def equals_of(settings: Sequence[Setting], best: Setting) -> int:
    """How many combinations are as good as the best: as many false constraints, and as many revisits closed."""
    return sum(_rank(one) == _rank(best) for one in settings)


def front_of(settings: Sequence[Setting]) -> list[Setting]:
    """Those of which no other has as few false constraints and a better recall, by false constraints."""
    front: list[Setting] = []
    for one in sorted(settings, key=lambda s: (s.total("false"), -(s.recall or 0.0))):
        if one.recall is not None and (not front or one.recall > (front[-1].recall or 0.0)):
            front.append(one)
    return front


def most_false(false: int, judged: int) -> float | None:
    """The share of false constraints that may be at most, with `CONFIDENCE` (Clopper and Pearson, 1934).

    It takes constraints for independent, which neighbours are not. None without any.
    """
    from scipy.stats import beta

    if judged == 0:
        return None
    return 1.0 if false >= judged else float(beta.ppf(CONFIDENCE, false + 1, judged - false))


def _rank(one: Setting) -> tuple[int, int, int]:
    return one.failed, one.total("false"), -one.total("closed")
