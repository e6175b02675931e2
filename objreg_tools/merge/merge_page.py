# SPDX-License-Identifier: Apache-2.0
"""A merge as a page: the stores before, in one frame after, the ties between them, what contradicts and what moved."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import replace
from typing import Any

from objreg_tools.merge.figures import Evaluation, figures
from objreg_tools.report.page import environment
from objreg_tools.report.store.moved_objects import Moves
from objreg_tools.report.store.session_map import session_maps
from objreg_tools.report.store.session_ties import joined
from objreg_tools.report.store.store_page import WIDTHS, WIDTHS_TIED, drawn_alone, drawn_together, label_styles
from objreg_tools.report.store.store_summary import StoreSummary, moves_as_text
from objreg_tools.report.store.tied_map import tied_maps
from objreg_tools.truth import Truths

MOST_DRAWN = 8  # sessions of a store that nothing ties to others, the oldest


def merge_page(found: Evaluation, summary: StoreSummary, truths: Truths | None = None) -> str:
    """The HTML of a merge; ``summary`` is the survey of the merged store."""
    styles = label_styles(summary)
    return environment().get_template("merge.html.j2").render(
        of=figures(found, truths),
        ties=len(found.ties),
        legend=[(styles[label], f"{label} ({count})") for label, count in summary.labels.items()],
        after=_drawings(summary, styles),
        before=[
            _drawings(part_of(summary, frozenset(store["sessions"].values())), styles) for store in found.merged.stores
        ],
        moves=moves_as_text(summary),
    )  # fmt: skip


def part_of(summary: StoreSummary, sessions: Set[int]) -> StoreSummary:
    """What some sessions of a store show by themselves."""
    return replace(
        summary,
        sightings=tuple(one for one in summary.sightings if one.session in sessions),
        ties=tuple(one for one in summary.ties if one.earlier in sessions and one.later in sessions),
        moves=Moves((), 0),
    )


def _drawings(summary: StoreSummary, styles: dict[str, str]) -> list[dict[str, Any]]:
    """The sessions that are tied, in one frame each, then those that are not, by themselves."""
    tied = {session for group in joined(summary.ties) for session in group}
    alone = [one for one in session_maps(summary) if one.session not in tied][:MOST_DRAWN]
    drawn = [
        _drawing(one.sessions, {name: drawn_together(one, styles, name) for name in WIDTHS_TIED})
        for one in tied_maps(summary)
    ]
    return drawn + [
        _drawing((one.session,), {name: drawn_alone(one, styles, name) for name in WIDTHS}) for one in alone
    ]


def _drawing(sessions: Sequence[int], svg: dict[str, str]) -> dict[str, Any]:
    return {"sessions": ", ".join(map(str, sessions)), "is_one": len(sessions) == 1, "svg": svg}
