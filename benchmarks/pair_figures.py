# SPDX-License-Identifier: Apache-2.0
"""What a method said of pairs of frames, and what the truth says of that.

Errors are of the camera's pose: strict, loose and wrong as for constraints; whatever is accepted of a pair that could
not close counts as wrong unless it is loose.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from frame_pairs import BINS, Pair

from objreg_ros.data.checked import Array
from objreg_tools.truth import FALSE, LOOSE, STRICT, Error, within


@dataclass
class Row:
    """What one method said of one pair: the error of its pose, whether it stands by it, and the time it took.

    ``lagged`` are the errors by the truth at other lags, where these are asked for.
    """

    error: Error | None
    accepted: bool
    ms: float
    reason: str = ""
    T: Array | None = field(default=None, repr=False)
    lagged: tuple[Error, ...] = ()

    def within(self, bound: Error) -> bool:
        """Whether there is a pose within a bound."""
        return self.error is not None and within(self.error, bound)


def is_wrong(pair: Pair, row: Row) -> bool:
    """Whether an accepted pose is a lie."""
    return row.accepted and not row.within(FALSE if pair.could_close else LOOSE)


def is_wrong_at_every_lag(pair: Pair, row: Row) -> bool:
    """Whether an accepted pose is a lie however late what was seen is."""
    bound = FALSE if pair.could_close else LOOSE
    return is_wrong(pair, row) and not any(within(error, bound) for error in row.lagged)


def summed(pairs: Sequence[Pair], rows: Sequence[Row]) -> dict[str, Any]:
    """The figures of one method over some pairs."""
    could = [(p, r) for p, r in zip(pairs, rows, strict=True) if p.could_close]
    share = lambda test: float(np.mean([test(r) for _, r in could])) if could else None  # noqa: E731
    found = [r.error for _, r in could if r.error is not None and r.within(LOOSE)]
    return {
        "tried": len(pairs),
        "could_close": len(could),
        "strict": share(lambda r: r.within(STRICT)),
        "loose": share(lambda r: r.within(LOOSE)),
        "accepted_strict": share(lambda r: r.accepted and r.within(STRICT)),
        "accepted_recall": share(lambda r: r.accepted and r.within(LOOSE)),
        "wrong": sum(is_wrong(p, r) for p, r in zip(pairs, rows, strict=True)),
        "wrong_at_every_lag": sum(is_wrong_at_every_lag(p, r) for p, r in zip(pairs, rows, strict=True)),
        "wrong_of_could_not": sum(is_wrong(p, r) for p, r in zip(pairs, rows, strict=True) if not p.could_close),
        "rotation_deg": float(np.median([e[0] for e in found])) if found else None,
        "translation_cm": float(np.median([e[1] for e in found])) if found else None,
        "ms_p50": float(np.percentile([r.ms for r in rows], 50)),
        "ms_p95": float(np.percentile([r.ms for r in rows], 95)),
        "refused": dict(Counter(r.reason for _, r in could if not r.accepted and r.reason)),
    }


def figures(pairs: Sequence[Pair], rows: Sequence[Row], middle: int) -> dict[str, Any]:
    """A method's figures: over all, by view change, and by half of the recording.

    A recording on which thresholds were fixed by its first half shows in the second how far they carry; ``across`` are
    the pairs of one frame of each.
    """
    out = summed(pairs, rows)
    out["by_view_change"] = {}
    for low, high in BINS:
        chosen = [k for k, p in enumerate(pairs) if p.could_close and low <= p.turned < high]
        if chosen:
            part = summed([pairs[k] for k in chosen], [rows[k] for k in chosen])
            out["by_view_change"][f"{low}-{high}"] = {
                key: part[key] for key in ("could_close", "loose", "accepted_recall", "wrong")
            }
    sides: dict[str, list[int]] = {"first": [], "second": [], "across": []}
    for k, pair in enumerate(pairs):
        late = (pair.source >= middle) + (pair.target >= middle)
        sides[("first", "across", "second")[late]].append(k)
    parts = {name: summed([pairs[k] for k in side], [rows[k] for k in side]) for name, side in sides.items() if side}
    shown = ("tried", "could_close", "loose", "accepted_recall", "wrong")
    out["half"] = {name: {key: part[key] for key in shown} for name, part in parts.items()}
    return out


def line(name: str, row: dict[str, Any]) -> str:
    """One method in one line."""
    show = lambda value: "  -  " if value is None else f"{value:.3f}"  # noqa: E731
    lagged = "" if row["wrong_at_every_lag"] == row["wrong"] else f", {row['wrong_at_every_lag']} at every lag"
    return (
        f"{name:28s} strict {show(row['strict'])} loose {show(row['loose'])} accepted {show(row['accepted_recall'])} "
        f"wrong {row['wrong']:3d} of {row['tried']}{lagged}  {row['ms_p50']:.0f} ms (p95 {row['ms_p95']:.0f})"
    )
