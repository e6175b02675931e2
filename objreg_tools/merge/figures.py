# SPDX-License-Identifier: Apache-2.0
"""What a merge came to, as JSON and in a few lines: stores, ties between them, the maps before and after."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from objreg_mapper.params import MapperParams
from objreg_ros.data.closures import LoopClosure
from objreg_ros.memory.store import Store
from objreg_tools.merge.merging import Merged
from objreg_tools.merge.one_map import Contradiction, OneMap, one_maps, tracks_of, within_sessions
from objreg_tools.truth import FALSE, Truths, within

MOST_SHOWN = 10  # contradictions that are printed; the JSON and the page have all


@dataclass(frozen=True)
class Evaluation:
    """The maps of each store by itself (``before``), and of the merged store (``after``); ``ties`` are between stores.

    ``store_of`` says of each session of the merged store which store it is from, by number.
    """

    merged: Merged
    counts: dict[str, int]
    before: tuple[list[OneMap], ...]
    after: list[OneMap]
    closures: list[LoopClosure]
    store_of: Mapping[int, int]

    @property
    def ties(self) -> list[LoopClosure]:
        """The closures between stores."""
        return [one for one in self.closures if len(set(self.stores_of(one))) == 2]

    @property
    def contradictions(self) -> list[Contradiction]:
        """Those of the merged store."""
        return [one for of in self.after for one in of.contradictions]

    def stores_of(self, closure: LoopClosure) -> list[int]:
        """The stores of both ends, as far as they are known."""
        ends = closure.from_session, closure.to_session
        return [self.store_of[end] for end in ends if end is not None and end in self.store_of]


def evaluate(merged: Merged, params: MapperParams | None = None) -> Evaluation:
    """Solve the maps of a merged store. StoreError where it is damaged."""
    store = Store(merged.path, read_only=True)
    try:
        tracks, closures, counts = tracks_of(store), list(store.closures()), store.counts()
    finally:
        store.close()
    own = [frozenset(of["sessions"].values()) for of in merged.stores]
    before = tuple(
        one_maps([track for track in tracks if track.session in of], within_sessions(closures, of), params)
        for of in own
    )
    store_of = {session: number for number, of in enumerate(own) for session in of}
    return Evaluation(merged, counts, before, one_maps(tracks, closures, params), closures, store_of)


def figures(found: Evaluation, truths: Truths | None = None) -> dict[str, Any]:
    """All of it as JSON: errors of maps and how many ties are false only where the truth is known."""
    return {
        "complete": True,
        "store": str(found.merged.path),
        "inputs": list(found.merged.stores),
        "counts": found.counts,
        "search": found.merged.counts,
        "damaged": list(found.merged.damaged),
        "ties": tie_rows(found),
        "ties_error": None if truths is None else _errors(found.ties, truths),
        "before": [[_map_row(one, truths) for one in of] for of in found.before],
        "after": [_map_row(one, truths) for one in found.after],
        "contradictions": [contradiction_row(found, one) for one in found.contradictions],
    }


def tie_rows(found: Evaluation) -> list[dict[str, Any]]:
    """How many closures tie which two sessions of two stores."""
    ends = ([(one.from_session or 0, one.from_robot), (one.to_session or 0, one.to_robot)] for one in found.ties)
    pairs = Counter(tuple(sorted(pair)) for pair in ends)
    return [
        {
            "stores": [found.store_of[session] for session, _ in pair],
            "sessions": [session for session, _ in pair],
            "robots": [robot for _, robot in pair],
            "closures": count,
        }
        for pair, count in sorted(pairs.items())
    ]


def contradiction_row(found: Evaluation, one: Contradiction) -> dict[str, Any]:
    """A contradiction as JSON."""
    closure = one.closure
    return {
        "why": one.why,
        "between_stores": len(set(found.stores_of(closure))) == 2,
        "robots": list(closure.robots),
        "sessions": [closure.from_session, closure.to_session],
        "stamps_ns": [closure.from_ns, closure.to_ns],
        "rotation_deg": one.rotation_deg,
        "translation_cm": one.translation_cm,
    }


def described(found: Evaluation, truths: Truths | None = None) -> str:
    """All of it in a few lines."""
    return "\n".join(_lines(found, figures(found, truths)))


def _lines(found: Evaluation, of: Mapping[str, Any]) -> list[str]:
    lines = [f"{of['store']}: {', '.join(f'{count} {name}' for name, count in of['counts'].items())}"]
    for number, store in enumerate(of["inputs"]):
        names = ", ".join(f"{there or 'no name'} is {here}" for there, here in store["robots"].items() if there != here)
        sessions = ", ".join(map(str, store["sessions"].values())) or "none"
        lines.append(f"  {store['path']}: sessions {sessions}{'; robot ' + names if names else ''}")
        lines.append(f"    alone: {_maps(of['before'][number])}")
    search = of["search"]
    lines.append(
        f"  between stores: {len(found.ties)} closures; {search.get('searched', 0)} keyframes were searched for, "
        f"{search.get('offered', 0)} places offered"
    )
    lines += [
        f"    sessions {row['sessions'][0]} and {row['sessions'][1]}: {row['closures']} closures" for row in of["ties"]
    ]
    if of["ties_error"] is not None:
        lines.append(f"    by the truth: {of['ties_error']['false']} of {of['ties_error']['of']} are false")
    lines.append(f"  together: {_maps(of['after'])}")
    return lines + _contradiction_lines(of["contradictions"])


def _contradiction_lines(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    lines = [f"  contradictions: {len(rows) or 'none'}"]
    for row in rows[:MOST_SHOWN]:
        seconds = " and ".join(f"{1e-9 * stamp:.2f} s" for stamp in row["stamps_ns"])
        off = (
            "" if row["translation_cm"] is None else f", {row['rotation_deg']:.1f}° and {row['translation_cm']:.1f} cm"
        )
        lines.append(f"    sessions {row['sessions'][0]} and {row['sessions'][1]} at {seconds}: {row['why']}{off}")
    return lines + ([f"    and {len(rows) - MOST_SHOWN} more"] if len(rows) > MOST_SHOWN else [])


def _maps(rows: Sequence[Mapping[str, Any]]) -> str:
    texts = []
    for row in rows:
        numbers, error = row["sessions"], row["error_cm"]
        which = f"sessions {', '.join(map(str, numbers))} in one frame" if len(numbers) > 1 else f"session {numbers[0]}"
        truth = "" if error is None else f", {error:.1f} cm from the truth"
        lost = f", {row['lost']} are of keyframes that are not stored any more" if row["lost"] else ""
        texts.append(f"{which} by {row['kept']} closures{lost}{truth}")
    return "; ".join(texts) or "no map"


def _map_row(one: OneMap, truths: Truths | None) -> dict[str, Any]:
    error = None if truths is None else one.error_cm(truths)
    return {
        "sessions": list(one.sessions),
        "keyframes": len(one.poses),
        "kept": one.kept,
        "lost": one.lost,
        "contradictions": len(one.contradictions),
        "error_cm": None if error is None else error[0],
        "error_of_keyframes": None if error is None else error[1],
    }


def _errors(ties: Sequence[LoopClosure], truths: Truths) -> dict[str, int]:
    known = [one for one in ties if set(one.robots) <= truths.of_robots.keys()]
    errors = truths.errors(known)
    return {"of": len(errors), "false": sum(not within(error, FALSE) for error in errors)}
