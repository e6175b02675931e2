# SPDX-License-Identifier: Apache-2.0
"""The next day: the first half of a recording is in the store, and every keyframe of the second half is judged.

A keyframe counts if it shows two objects where the day before had stored them (by label and true place). It is answered
if the registrar says, once that keyframe is done, where the camera is in the map of the day before: by a closure of its
own or by an earlier one and odometry. An answer is judged as in `relocalisation.py`, in the odometry of the day before
as that was at the keyframe that the answer is by. It is wrong beyond 8 degrees or 15 cm (FALSE), and so is a closure.
"""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

from sessions import LATER_NS, Earlier, begun_anew, remember

from objreg_ros.data.frames import UNNAMED, Frame
from objreg_ros.geometry import pose_error, transform
from objreg_ros.registrar.outcome import Outcome
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.registrar import Registrar
from objreg_tools.truth import FALSE, STRICT, Truth, within

NEAR_CM = 50.0
TWO = 2  # known objects that a keyframe shows, to count
Row = dict[str, Any]


def measure(frames: list[Frame], truth: Truth, params: RegistrarParams) -> list[Row]:
    """A row for every keyframe of the second half."""
    half = len(frames) // 2
    earlier = Earlier.of(frames[:half], truth)
    with tempfile.TemporaryDirectory() as folder:
        store = Path(folder) / "earlier.db"
        remember(store, frames[:half], params)
        return next_day(frames[half:], store, earlier, truth, params)


def next_day(
    frames: Sequence[Frame], store: Path, earlier: Earlier, truth: Truth, params: RegistrarParams
) -> list[Row]:
    """Go through the later session to its end."""
    rows: list[Row] = []
    began_ns = frames[0].stamp_ns
    with closing(Registrar(params.replaced(store=str(store)))) as registrar:
        for frame in begun_anew(frames):
            outcome = registrar.process(frame)
            _add(rows, registrar, outcome, earlier, truth, began_ns)
        _add(rows, registrar, registrar.finish(), earlier, truth, began_ns)
    return rows


def _add(
    rows: list[Row], registrar: Registrar, outcome: Outcome, earlier: Earlier, truth: Truth, began_ns: int
) -> None:
    """A row of the keyframe that a frame completed, if it did; late constraints go to the rows of theirs."""
    if outcome.keyframe_ns is not None:
        stamp_ns = outcome.keyframe_ns - LATER_NS
        row: Row = {"at_s": round(1e-9 * (stamp_ns - began_ns), 2), "keyframe_ns": stamp_ns}
        row |= {"known": _known(outcome, earlier, truth), "answer": None, "closed": 0, "late": 0, "closures": []}
        refused = [one for one in outcome.rejected if one.to_ns == outcome.keyframe_ns]
        between = [one for one in refused if one.from_session != one.to_session or one.from_ns == one.to_ns]
        row["reasons"] = dict(Counter(one.reason.value for one in between))
        row |= _answer(registrar, earlier, truth)
        rows.append(row)
    for closure in outcome.closures:
        if closure.from_session != closure.to_session:
            of = next(row for row in rows if row["keyframe_ns"] == closure.to_ns - LATER_NS)
            of["closed"] += closure.to_ns == outcome.keyframe_ns
            of["late"] += closure.to_ns != outcome.keyframe_ns
            of["closures"].append(_rounded(truth.error(replace(closure, to_ns=closure.to_ns - LATER_NS))))


def _known(outcome: Outcome, earlier: Earlier, truth: Truth) -> int:
    """How many objects a keyframe shows that the earlier session stored there; 0 where its truth is not known."""
    assert outcome.keyframe_ns is not None
    T = truth.at(outcome.keyframe_ns - LATER_NS)
    named = [one for one in outcome.observations if one.label != UNNAMED]
    return 0 if T is None else earlier.known_among([(one.label, transform(T, one.xyz)) for one in named])


def _answer(registrar: Registrar, earlier: Earlier, truth: Truth) -> Row:
    """Where the newest camera is known to be: by how many closures, and the error in degrees and centimetres."""
    found = registrar.relocalised
    T = None if found is None else truth.at(found.stamp_ns - LATER_NS)
    if found is None or T is None:
        return {"whereabouts": registrar.whereabouts}
    error = pose_error(found.T_map_camera, earlier.T_map_camera(T, found.target_ns))
    sigmas_cm = [round(100 * float(value) ** 0.5, 1) for value in found.covariance.diagonal()[:3]]
    return {"answer": _rounded(error), "by": found.closures, "sigmas_cm": sigmas_cm}


def _rounded(error: tuple[float, float] | None) -> list[float] | None:
    return None if error is None else [round(part, 2) for part in error]


def summary(rows: Sequence[Row]) -> Row:
    """Of keyframes that show two known objects the shares that are answered so well; of all what is wrong."""
    could = [row for row in rows if row["known"] >= TWO]
    errors = [tuple(row["answer"]) for row in could if row["answer"] is not None]
    near, strict = sum(cm <= NEAR_CM for _, cm in errors), sum(within(error, STRICT) for error in errors)
    closures = [tuple(error) for row in rows for error in row["closures"] if error is not None]
    answers = [tuple(row["answer"]) for row in rows if row["answer"] is not None]
    missed = [row for row in could if row["answer"] is None]
    return {
        "keyframes": len(rows),
        "could": len(could),
        "answered": len(errors),
        "closed": sum(row["closed"] > 0 for row in could),
        "near": near,
        "near_share": round(near / max(len(could), 1), 3),
        "strict": strict,
        "strict_share": round(strict / max(len(could), 1), 3),
        "answers": len(answers),
        "wrong": sum(not within(error, FALSE) for error in answers),
        "closures": len(closures),
        "wrong_closures": sum(not within(error, FALSE) for error in closures),
        "missed_by_reason": dict(sum((Counter(row["reasons"]) for row in missed), Counter())),
    }


def line(name: str, figures: Row) -> str:
    """A row of the table."""
    near = f"{figures['near']} = {figures['near_share']:.3f}"
    strict = f"{figures['strict']} = {figures['strict_share']:.3f}"
    wrong = f"{figures['wrong']} of {figures['answers']}"
    closures = f"{figures['wrong_closures']} of {figures['closures']}"
    counts = f"{figures['keyframes']:>9} {figures['could']:>10} {figures['closed']:>7}"
    return f"{name:28} {counts} {near:>13} {strict:>13} {wrong:>11} {closures:>14}"


HEAD = (
    f"{'recording':28} {'keyframes':>9} {'two known':>10} {'closed':>7} {'within 0.5 m':>13} {'5 cm, 3 deg':>13}"
    f" {'wrong':>11} {'wrong closures':>14}"
)
TABLE = summary, line
