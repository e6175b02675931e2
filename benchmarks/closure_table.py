# SPDX-License-Identifier: Apache-2.0
"""The figures of `closure` over several recordings, as text and as a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

Row = dict[str, Any]
COLOURS = {"objreg": "#2a78d6", "oracle": "#8b8a83", "orb_pnp": "#c98500", "fpfh_icp": "#1baf7a", "paper": "#d55181"}


def grouped(rows: Mapping[str, Row]) -> dict[str, dict[str, Row]]:
    """Recordings of one scenario together: the name up to its seed."""
    groups: dict[str, dict[str, Row]] = {}
    for name, row in rows.items():
        scenario, _, seed = name.rpartition("_")
        groups.setdefault(scenario if seed.isdigit() else name, {})[name] = row
    return groups


def totals(rows: Sequence[Row]) -> dict[str, Row]:
    """Method → counts added up over recordings, and the worst and the median reduction of the trajectory error."""
    out: dict[str, Row] = {}
    for name in rows[0]["methods"]:
        of = [row["methods"][name] for row in rows]
        pairs = sum(m["pairs"] for m in of)
        reduced = [m["ate_reduced"] for m in of]
        out[name] = {
            **{key: sum(m[key] for m in of) for key in ("constraints", "true", "false", "pruned")},
            "recall": {b: {k: sum(m["recall"][b][k] for m in of) for k in ("closed", "of")} for b in of[0]["recall"]},
            "ms_per_pair": round(sum(m["ms_per_pair"] * m["pairs"] for m in of) / max(pairs, 1), 2),
            "ate_cm": {k: round(float(np.median([m["ate_cm"][k] for m in of])), 2) for k in ("before", "after")},
            "ate_reduced_worst": min(reduced),
            "ate_reduced_median": round(float(np.median(reduced)), 3),
            "recordings": len(rows),
        }
    return out


def table(name: str, row: Row) -> str:
    """The methods of one recording as text."""
    head = (
        f"{name}: {row['frames']} frames, {row['keyframes']} keyframes, {row['revisits']} revisits, {row['path_m']} m"
    )
    lines = [head, f"  {'method':10} {'constr.':>7} {'true':>5} {'false':>5} {'recall':>7} {'ms/pair':>8}  ATE cm"]
    return "\n".join([*lines, *(_line(method, m, m["ate_reduced"]) for method, m in row["methods"].items())])


def table_of_totals(group: str, methods: Mapping[str, Row]) -> str:
    """The methods over the recordings of one scenario as text."""
    count = next(iter(methods.values()))["recordings"]
    head = f"{group}, {count} recordings: counts added up, ATE median and its smallest reduction"
    return "\n".join([head, *(_line(method, m, m["ate_reduced_worst"]) for method, m in methods.items())])


def _line(method: str, m: Row, reduced: float) -> str:
    bins = "  ".join(f"{name}° {r['closed']}/{r['of']}" for name, r in m["recall"].items() if name != "all" and r["of"])
    every, ate = m["recall"]["all"], m["ate_cm"]
    return (
        f"  {method:10} {m['constraints']:7} {m['true']:5} {m['false']:5} {every['closed']:3}/{every['of']:<3} "
        f"{m['ms_per_pair']:8.1f}  {ate['before']:.1f} → {ate['after']:.1f} ({100 * reduced:.0f} %)  {bins}"
    )


def draw(rows: Mapping[str, Row], file: Path) -> None:
    """For every scenario the trajectory error of each recording, and the recall by view change, of all methods."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    groups = grouped(rows)
    figure, axes = pyplot.subplots(2, len(groups), figsize=(1.2 + 3.3 * len(groups), 6.0), squeeze=False)
    for column, (group, members) in enumerate(groups.items()):
        _draw_errors(axes[0, column], group, list(members.values()))
        _draw_recall(axes[1, column], totals(list(members.values())))
    axes[0, 0].set_ylabel("trajectory error, cm")
    axes[1, 0].set_ylabel("share of revisits closed")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=len(labels), frameon=False)
    figure.tight_layout(rect=(0, 0.05, 1, 1))
    figure.savefig(file, dpi=110)


def _draw_errors(axis: Any, group: str, rows: Sequence[Row]) -> None:
    at = np.arange(len(rows))
    before = [next(iter(row["methods"].values()))["ate_cm"]["before"] for row in rows]
    axis.bar(at, before, width=0.8, color="#e2e1da", label="odometry")
    for method in rows[0]["methods"]:
        after = [row["methods"][method]["ate_cm"]["after"] for row in rows]
        marker = "_" if method == "oracle" else "o"
        axis.plot(at, after, marker, color=COLOURS.get(method), markersize=14 if marker == "_" else 6, label=method)
    axis.set_title(group)
    axis.set_xticks(at)
    axis.set_xlabel("recording")
    axis.set_ylim(0)


def _draw_recall(axis: Any, methods: Mapping[str, Row]) -> None:
    shown = {name: m["recall"] for name, m in methods.items() if name != "oracle"}
    bins = [b for b, r in next(iter(shown.values())).items() if b != "all" and r["of"]]
    width = 0.8 / max(len(shown), 1)
    for k, (method, recall) in enumerate(shown.items()):
        shares = [recall[b]["closed"] / recall[b]["of"] for b in bins]
        axis.bar(np.arange(len(bins)) + (k + 0.5) * width - 0.4, shares, width, color=COLOURS.get(method))
    axis.set_xticks(np.arange(len(bins)), [f"{b}°" for b in bins])
    axis.set_xlabel("view change")
    axis.set_ylim(0, 1)
