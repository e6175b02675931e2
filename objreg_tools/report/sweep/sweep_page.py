# SPDX-License-Identifier: Apache-2.0
"""A sweep as a page: the curves, every combination in a table, and the best of them to copy."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from typing import Any

from objreg_tools.report.page import environment
from objreg_tools.report.run.figures import NARROW, WIDE
from objreg_tools.report.sweep.sweep_figures import (
    COLOURS,
    against_parameters,
    constraints_against_odds,
    recall_against_false,
    styles_of,
)
from objreg_tools.report.sweep.sweep_rows import Setting, best_of, equals_of, is_judged, most_false, ranked, shown
from objreg_tools.report.sweep.sweep_tables import as_yaml

NO_TRUTH = (
    "No ground truth covers a revisit, so nothing says which constraints are false, and no combination is named the "
    "best. More constraints are not better ones: look at those of the lowest odds in the report of a run."
)


def sweep_page(settings: Sequence[Setting], about: Mapping[str, Any]) -> str:
    """The HTML of a sweep; ``about`` lists by name what all its runs have in common."""
    order, best = ranked(settings), best_of(settings)
    styles = styles_of(order)
    by_width = {width: list(against_parameters(settings, width)) for width in (WIDE, NARROW)}
    return environment().get_template("sweep.html.j2").render(
        about=about,
        recordings=settings[0].found if settings else (),
        names=list(settings[0].values) if settings else [],
        rows=[_row(one, styles[id(one)], one is best) for one in order],
        judged=is_judged(settings),
        best=None if best is None else {"set": set_words(best), "yaml": as_yaml(best), "found": best.found},
        verdict=verdict(settings),
        recall={"wide": recall_against_false(order), "narrow": recall_against_false(order, NARROW)},
        odds={"wide": constraints_against_odds(order), "narrow": constraints_against_odds(order, NARROW)},
        parameters=[
            {"name": wide["name"], "wide": wide["svg"], "narrow": narrow["svg"]}
            for wide, narrow in zip(by_width[WIDE], by_width[NARROW], strict=True)
        ],
        legend=[(styles[id(one)], one.text) for one in order[:COLOURS]],
        failures=_failures(settings),
        more=max(0, len(order) - COLOURS),
    )  # fmt: skip


def verdict(settings: Sequence[Setting]) -> list[str]:
    """Which combination is best and how far that can be trusted, a sentence each."""
    if not is_judged(settings):
        return [NO_TRUTH]
    best = best_of(settings)
    if best is None:
        return ["Every combination failed on some recording, so none is named the best."]
    false, judged = best.total("false"), best.total("judged")
    recall = f"{best.total('closed')} of {best.total('revisits')} revisits closed"
    sentences = [f"Best: {best.text}: {recall}, {false} of {judged} constraints false."]
    if (equals := equals_of(settings, best)) > 1:
        sentences.append(f"{equals} combinations are equally good; this is the nearest of them to the defaults.")
    bound = most_false(false, judged)
    if bound is not None:
        sentences.append(f"So few constraints do not show a share of false ones below {100 * bound:.1f} % (95 %).")
    covered = sum(bool(one.revisits) for one in best.found)
    if covered < 2:
        sentences.append("Only one recording has truth: what is best in it need not be in another.")
    return sentences


def set_words(one: Setting) -> str:
    """The values as the words of `--set`, for a shell."""
    return " ".join(f"--set {shlex.quote(change)}" for change in one.changes)


def _failures(settings: Sequence[Setting]) -> list[str]:
    return [f"{bad.name}, with {one.text}: {bad.error}" for one in settings for bad in one.found if bad.error]


def _row(one: Setting, style: str, is_best: bool) -> dict[str, Any]:
    return {
        "style": style,
        "is_best": is_best,
        "values": [shown(value) for value in one.values.values()],
        "recall": None if one.recall is None else 100 * one.recall,
        "closed": one.total("closed"),
        "revisits": one.total("revisits"),
        "false": one.total("false") if one.total("judged") else None,
        "loose": one.total("loose") if one.total("judged") else None,
        "constraints": one.total("constraints"),
        "failed": one.failed,
        "set": set_words(one),
    }
