# SPDX-License-Identifier: Apache-2.0
"""Counts and comparisons in words, for pages and for the terminal."""

from __future__ import annotations


def number_of(count: int, noun: str) -> str:
    """``1 loop``, ``2 loops``."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def reading(value: float | None) -> str:
    """``5,980``, ``0.0323``; ``unknown`` for what was not measured."""
    if value is None:
        return "unknown"
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"


def judgement(false: int, judged: int, count: int) -> str:
    """How many of so many constraints are false, of those that truth can judge."""
    if not judged:
        return f"there is no truth to judge {'it' if count == 1 else 'them'} by"
    of = ("the only one" if count == 1 else f"the {count}") if judged == count else f"the {judged} that truth can judge"
    verb = "are" if false > 1 else "is"
    found = f"{false or 'none'} of {of} {verb} false" if judged > 1 else f"{of} is {'' if false else 'not '}false"
    return found if judged == count else f"{found}; {count - judged} could not be judged"


def change(before: float, after: float, source: str) -> str:
    """How much better or worse a corrected trajectory is than its ``source``, by their errors."""
    percent = round(100.0 * abs(1.0 - after / before)) if before > 0 else 0
    if not percent:
        return f"as good as {source}"
    return f"{percent} % {'better' if after < before else 'worse'} than {source}"
