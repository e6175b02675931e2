# SPDX-License-Identifier: Apache-2.0
"""Runs side by side: what differs between them, and which constraints one has and another lacks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from string import ascii_uppercase
from typing import Any, Protocol

from objreg_ros.data.closures import LoopClosure
from objreg_ros.registrar.params import RegistrarParams
from objreg_tools.report.run.pairs import PairRow, pairs_of
from objreg_tools.report.run.run_summary import RunSummary
from objreg_tools.report.run.sections import View, judged, spaced
from objreg_tools.report.run.trajectory_error import root_mean_square

DEFAULT = "default"
KEYFRAME_NS = round(RegistrarParams().keyframe_seconds * 1e9)  # stamps so near are of one keyframe


class Ends(Protocol):
    """What lies between two stamps."""

    @property
    def from_ns(self) -> int: ...

    @property
    def to_ns(self) -> int: ...


def comparison(all_runs: Sequence[RunSummary]) -> View:
    """The section of two runs or more; each after the first is held against the first."""
    names = names_of(all_runs)
    recordings = {run.summary.get("recording", "") for run in all_runs}
    same = len(recordings) == 1
    changes = [_change(all_runs, k, names) for k in range(1, len(all_runs))] if same else []
    return {"names": names, "table": _table(all_runs), "changes": changes, "same": same}


def names_of(all_runs: Sequence[RunSummary]) -> list[str]:
    """A letter for each run, and what differs from the others: parameters, model, version, recording."""
    flats = [_flat(run) for run in all_runs]
    keys = dict.fromkeys(key for made in flats for key in made)
    differing = [key for key in keys if len({str(made.get(key, DEFAULT)) for made in flats}) > 1]
    names = []
    for k, made in enumerate(flats):
        text = ", ".join(f"{key} {made.get(key, DEFAULT)}" for key in differing)
        letter = ascii_uppercase[k] if k < len(ascii_uppercase) else str(k + 1)
        names.append(f"{letter}: {text}" if text else f"{letter}: {all_runs[k].name}, made as the others")
    return names


def _flat(run: RunSummary) -> dict[str, Any]:
    """What a run was made with, by name; without what always differs."""
    about: Mapping[str, Any] = run.summary.get("about", {})
    model = about.get("model") or {}
    made = {
        **about.get("params", {}),
        "model": f"{model.get('name')} {model.get('sha256')}" if model else None,
        "version": about.get("version"),
        "commit": about.get("commit"),
        "recording": run.name,
        "odometry": run.summary.get("odometry"),
    }
    made.pop("detector.model", None)
    return {key: value for key, value in made.items() if value is not None}


def _table(all_runs: Sequence[RunSummary]) -> list[tuple[str, list[str]]]:
    """Rows of a measure and its value in each run."""
    rows = [
        ("frames", [_count(run, "frames") for run in all_runs]),
        ("detections", [_count(run, "detections") for run in all_runs]),
        ("objects", [_count(run, "objects") for run in all_runs]),
        ("constraints", [f"{len(run.closures)}" for run in all_runs]),
        ("false constraints", [_false(run) for run in all_runs]),
        ("error before correction", [_trajectory_error(run, "odometry_error") for run in all_runs]),
        ("error corrected", [_trajectory_error(run, "corrected_error") for run in all_runs]),
    ]
    reasons = dict.fromkeys(reason for run in all_runs for reason in run.summary.get("rejected", {}))
    stages = dict.fromkeys(stage for run in all_runs for stage in run.summary.get("stage_ms", {}))
    refused = [(spaced(reason), [_refused(run, reason) for run in all_runs]) for reason in reasons]
    return [*rows, *refused, *((f"{stage}, median", [_time(run, stage) for run in all_runs]) for stage in stages)]


def _count(run: RunSummary, key: str) -> str:
    return f"{run.summary[key]:,}" if key in run.summary else "–"


def _false(run: RunSummary) -> str:
    false, of = judged(run)
    return f"{false} of {of}" if of else "–"


def _trajectory_error(run: RunSummary, which: str) -> str:
    errors = getattr(run.tracks(), which, None)
    return "–" if errors is None else f"{100 * root_mean_square(errors):.1f} cm"


def _refused(run: RunSummary, reason: str) -> str:
    return str(run.summary.get("rejected", {}).get(reason, 0))


def _time(run: RunSummary, stage: str) -> str:
    ms = run.summary.get("stage_ms", {}).get(stage)
    return "–" if ms is None else f"{ms['p50']:.1f} ms"


def _change(all_runs: Sequence[RunSummary], k: int, names: Sequence[str]) -> View:
    """What a run gained and lost against the first."""
    before, after = all_runs[0], all_runs[k]
    kept = matched(before.closures, after.closures)
    lost = [pair for i, pair in enumerate(pairs_of(before)[: len(before.closures)]) if i not in kept]
    gained = [pair for i, pair in enumerate(pairs_of(after)[: len(after.closures)]) if i not in kept.values()]
    return {
        "title": f"{names[k].split(':')[0]} against {names[0].split(':')[0]}",
        "kept": len(kept),
        "gained": [_changed(pair, k, before) for pair in gained],
        "lost": [_changed(pair, 0, after) for pair in lost],
    }


def matched(before: Sequence[Ends], after: Sequence[Ends]) -> dict[int, int]:
    """Which closure of one run is which of another: both stamps within `KEYFRAME_NS`, the nearest first."""
    near = sorted(
        (apart, i, j)
        for i, one in enumerate(before)
        for j, other in enumerate(after)
        if (apart := _apart_ns(one, other)) <= KEYFRAME_NS
    )
    found: dict[int, int] = {}
    taken: set[int] = set()
    for _, i, j in near:
        if i not in found and j not in taken:
            found[i] = j
            taken.add(j)
    return found


def _apart_ns(one: Ends, other: Ends) -> int:
    return max(abs(one.from_ns - other.from_ns), abs(one.to_ns - other.to_ns))


def _changed(pair: PairRow, run: int, other: RunSummary) -> View:
    """A closure that only one run has, and what became of it in the other."""
    error = "" if pair.error is None else f"{pair.error[0]:.1f}° and {pair.error[1]:.1f} cm"
    times = f"{pair.seconds[0]:.1f} s ↔ {pair.seconds[1]:.1f} s"
    labels = ", ".join(pair.labels)
    return {"run": run, "key": pair.key, "verdict": pair.verdict, "times": times, "labels": labels, "error": error,
            "instead": _instead(pair, other)}  # fmt: skip


def _instead(pair: PairRow, other: RunSummary) -> str:
    """Why the other run refused the same pair; ``not tried`` where it did not try it."""
    if not isinstance(pair.outcome, LoopClosure):
        return ""
    near = [
        (apart, refusal) for refusal in other.refusals if (apart := _apart_ns(pair.outcome, refusal)) <= KEYFRAME_NS
    ]
    if not near:
        return "not tried"
    refusal = min(near, key=lambda item: item[0])[1]
    return f"{spaced(refusal.reason.value)}: {refusal.detail}"
