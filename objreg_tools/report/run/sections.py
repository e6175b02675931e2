# SPDX-License-Identifier: Apache-2.0
"""What the sections of one run show: plain data for the templates."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from objreg_ros.data.closures import UNTRIED
from objreg_tools.report.closures.matched_objects import Drawn, pair_drawing
from objreg_tools.report.closures.weighed_evidence import EVIDENCE, weighed
from objreg_tools.report.packed import zipped
from objreg_tools.report.pair.pair_command import pair_command, veto_command
from objreg_tools.report.run import clouds, figures, thumbnails
from objreg_tools.report.run.camera_map import of_one_clock
from objreg_tools.report.run.clouds import Clouds
from objreg_tools.report.run.pairs import ACCEPTED, PairRow, pairs_of
from objreg_tools.report.run.pictures import Album, chosen_closures, chosen_refusals, data_uri, overlay
from objreg_tools.report.run.reasons import MEANINGS
from objreg_tools.report.run.run_summary import RunSummary, Tracks
from objreg_tools.report.run.scene import NAMES, scene
from objreg_tools.report.run.thumbnails import Thumbnails
from objreg_tools.report.run.trajectory_error import root_mean_square
from objreg_tools.report.words import change, judgement, number_of

View = dict[str, Any]

OVERLAID = (
    "Right: the second picture laid over the first by the constraint, magenta over green. Grey is agreement, coloured "
    "fringes are not; dark was not seen by both."
)


def view_of_run(run: RunSummary, album: Album | None, runs: int = 1, spatial: bool = True) -> View:
    """Everything that a run's part of a page of so many runs shows; ``spatial`` with what is in 3D."""
    tracks = run.tracks()
    pairs = pairs_of(run)
    drawn = thumbnails.thumbnails(pairs, album, thumbnails.PAGE_BYTES // runs)
    solid = clouds.clouds(pairs, album, drawn.moments, clouds.PAGE_BYTES // runs) if spatial else None
    return {
        "name": run.name,
        "said": _said(run),
        "findings": run.summary.get("findings", ()),
        "assumed": run.summary.get("assumed", {}),
        "tiles": _tiles(run, tracks),
        "about": about_rows(run.summary.get("about", {})),
        "trajectory": _trajectory_view(run, tracks),
        "timeline": _timeline(run),
        "reasons": _reasons(run),
        "pairs": _browser(pairs, drawn, album),
        "clouds": None if solid is None else _clouds(solid),
        "galleries": [] if album is None else _galleries(pairs, run, album),
        "objects": _objects(run),
        "stages": _stages(run),
    }


def spaced(name: str) -> str:
    """The name of a reason as it reads on a page."""
    return name.replace("_", " ")


def judged(run: RunSummary) -> tuple[int, int]:
    """How many constraints are false, and how many truth covers."""
    errors = sum(run.error(closure) is not None for closure in run.closures)
    return sum(map(run.is_false, run.closures)), errors


def about_rows(about: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What a run was made with, line by line; nothing where its JSON lacks it."""
    model = about.get("model") or {}
    rows = {
        "command": about.get("command"),
        "version": " ".join(filter(None, (about.get("version"), about.get("commit")))),
        "date": about.get("date"),
        "recording": about.get("recording"),
        "model": _model_text(model) if model else "",
        "not the defaults": ", ".join(f"{name} = {value}" for name, value in about.get("params", {}).items()),
    }
    return [(name, str(text)) for name, text in rows.items() if text]


def _model_text(model: Mapping[str, Any]) -> str:
    text = f"{model.get('name')} (sha256 {model.get('sha256')}…)"
    return f"{text}, threshold {model['threshold']}" if "threshold" in model else text


def _said(run: RunSummary) -> str:
    said = _verdict(run)
    lens = "" if run.summary.get("assumed") else run.summary.get("lens")  # which has it
    return f"{said} Lens: {lens}." if lens else said


def _verdict(run: RunSummary) -> str:
    if not run.closures:
        sure = "" if run.summary.get("findings") or not run.refusals else ": no candidate was certain enough"
        return f"No loop was closed{sure}."
    labels = [label for closure in run.closures for label in closure.labels]
    seen = ", ".join(sorted(set(labels), key=lambda label: -labels.count(label))[:5])
    by = f", by {seen}" if seen else ""
    false, of = judged(run)
    found = run.closed_revisits.text
    return f"{found[0].upper()}{found[1:]}{by}; {judgement(false, of, len(run.closures))}."


def _tiles(run: RunSummary, tracks: Tracks | None) -> list[View]:
    false, of = judged(run)
    tiles = [
        _tile(f"{run.summary.get('frames', len(run.glimpses)):,}", "frames", _count_note(run)),
        *_revisits_tile(run),
        _tile(f"{len(run.closures)}", "constraints", _refused_note(run)),
    ]
    if of:
        tiles.append(
            _tile(f"{false}", "false constraints", f"of {of} that truth can judge", "bad" if false else "good")
        )
    if tracks is not None and tracks.odometry_error is not None and tracks.corrected_error is not None:
        before, after = (100 * root_mean_square(e) for e in (tracks.odometry_error, tracks.corrected_error))
        source = NAMES.get(tracks.source, tracks.source)
        tone = "bad" if after > before else ""
        tiles.append(
            _tile(f"{before:.1f} → {after:.1f} cm", "trajectory error", f"RMS, {change(before, after, source)}", tone)
        )
    return tiles


def _revisits_tile(run: RunSummary) -> list[View]:
    """How many revisits were closed; none where no constraint shows any and it is not known."""
    closed = run.closed_revisits
    if not closed.revisits and (closed.unknown or not run.closures):
        return []
    note = f"closed by {number_of(closed.closing, 'constraint')}" if closed.revisits else "the camera never left"
    return [_tile(f"{len(closed.revisits)}", "revisits", note)]


def _tile(value: str, name: str, note: str, tone: str = "") -> View:
    return {"value": value, "name": name, "note": note, "tone": tone}


def _refused_note(run: RunSummary) -> str:
    """How many candidates were refused, and how many more in the table of reasons were not tried."""
    counts = run.summary.get("rejected", {})
    untried = sum(counts.get(reason.value, 0) for reason in UNTRIED)
    tried = f"{sum(counts.values()) - untried} candidates refused"
    return f"{tried}, {untried} more not tried" if untried else tried


def _count_note(run: RunSummary) -> str:
    if "detections" not in run.summary:
        return "with colour and depth"
    return f"{run.summary['detections']:,} detections, {run.summary.get('objects', 0):,} objects"


def _trajectory_view(run: RunSummary, tracks: Tracks | None) -> View:
    """The drawings of the trajectory; of the truth without odometry, and of our own tracking without either."""
    if tracks is not None:
        stamps_ns, lines, text = tracks.stamps_ns, tracks.lines, _trajectory_text(run, tracks)
    elif (true := run.true_trajectory()) is not None:
        stamps_ns, lines = true[0], {"true": true[1]}
        text = "From above. There is no odometry in this run: the trajectory is the ground truth, and is not corrected."
    elif (tracked := run.tracked_trajectory()) is not None:
        stamps_ns, lines = tracked[0], {"tracked": tracked[1][:, :3, 3]}
        text = (
            "From above. There is neither odometry nor ground truth in this run: the trajectory is our own tracking's, "
            f"in its longest stretch, {len(stamps_ns)} of {len(run.glimpses)} frames, and is not corrected."
        )
    else:
        text = "There is neither odometry nor ground truth in this run, and no track of the camera: no trajectory."
        return {"text": text, "legend": [], "drawing": None, "error": None, "scene": None}
    names = {**NAMES, "accepted": "closure"}
    marks = [*lines, *sorted({figures.verdict(run, closure) for closure in run.closures})]
    return {
        "text": text,
        "legend": [(mark, names.get(mark, "false closure" if mark == "false" else mark)) for mark in marks],
        "drawing": _in_both_widths(lambda width: figures.trajectory(run, stamps_ns, lines, width)),
        "scene": scene(run, stamps_ns, lines, tracks),
        "error": None if tracks is None else _in_both_widths(lambda w: figures.error_over_time(run, tracks, w)),
    }


def _in_both_widths(draw: Callable[[int], str], wide: int = figures.WIDE) -> View | None:
    """A drawing for a page and for a telephone; None where there is nothing to draw."""
    drawn = draw(wide)
    return {"wide": drawn, "narrow": draw(figures.NARROW)} if drawn else None


def _trajectory_text(run: RunSummary, tracks: Tracks) -> str:
    source = NAMES.get(run.source, run.source)
    text = f"From above. {_corrected(run, tracks, source)}"
    if run.by_tracking:
        text += f" {_pieces(run)}"
    if run.pruned:
        text += f" The mapper pruned {len(run.pruned)} of {len(run.closures)} closures."
    if run.map.unsolved:
        text += f" The corrected trajectory is that of {source} here: {run.map.unsolved}."
    if run.left_out:
        text += f" {run.left_out} frames are left out: their time is not later than that of the frames before them."
    across = len(run.closures) - len(of_one_clock(run.closures))
    if across:
        text += f" {across} closures are left out: they tie two runs of the clock, and the map is of one."
    return text


def _corrected(run: RunSummary, tracks: Tracks, source: str) -> str:
    """What constraints make of the trajectory, and by truth whether it is better for them."""
    if not run.closures:
        return f"No constraint corrects {source}."
    text = f"Constraints tie keyframes that saw the same place; the pose graph corrects {source} by them"
    if tracks.odometry_error is None or tracks.corrected_error is None:
        return f"{text}; there is no truth to say whether it is better for it."
    before, after = map(root_mean_square, (tracks.odometry_error, tracks.corrected_error))
    return f"{text}. By truth the corrected trajectory is {change(before, after, source)}."


def _pieces(run: RunSummary) -> str:
    """What of our own tracking is drawn."""
    known = run.map
    text = f"There is no odometry in this run: {len(known.frames)} of {len(run.glimpses)} frames are drawn, which "
    text += f"closures tie out of {known.sessions} sessions." if known.sessions > 1 else "are of one session."
    if not known.sessions_apart:
        return text
    apart = number_of(known.sessions_apart, "more session")
    return f"{text} {known.frames_apart} frames in {apart} are not: nothing ties them."


def _timeline(run: RunSummary) -> View | None:
    if not (run.glimpses or run.closures or run.refusals):
        return None
    entries = [("seen", "detected"), ("accepted", "closure"), ("refused", "refused candidate")]
    if any(map(run.is_false, run.closures)):
        entries.insert(2, ("false", "false closure"))
    text = "What was detected, which keyframes were tied together, and what was refused and why."
    if run.out_of_time:
        counts = ", ".join(f"{count} {what}" for what, count in run.out_of_time.items())
        text += f" Left out: {counts}, more than an hour from the longest part of the run; are their stamps right?"
    drawing = _in_both_widths(lambda width: figures.timeline(run, width))
    return {"text": text, "legend": entries, "drawing": drawing}


def _reasons(run: RunSummary) -> list[View]:
    counts = run.summary.get("rejected", {})
    examples = {refusal.reason.value: refusal.detail for refusal in reversed(run.refusals)}
    return [
        {"name": spaced(name), "count": count, "meaning": MEANINGS.get(name, ""), "example": examples.get(name, "")}
        for name, count in sorted(counts.items(), key=lambda item: -item[1])
    ]


def _browser(pairs: Sequence[PairRow], drawn: Thumbnails, album: Album | None) -> View:
    """The table of all pairs, what its pictures lack, and what a pane shows of each."""
    counts = Counter(pair.reason for pair in pairs)
    return {
        "rows": [_row(pair) for pair in pairs],
        "filters": [(name, spaced(name), count) for name, count in counts.most_common()],
        "false": sum(pair.verdict == "false" for pair in pairs),
        "lacking": _lacking(drawn, len(pairs)) if album is not None else "There are no pictures of this run.",
        "data": {
            "pairs": {pair.key: _pane(pair, drawn) for pair in pairs},
            "marks": _marks(drawn),
            "kinds": {name: [kind.text, kind.limit] for name, kind in EVIDENCE.items()},
            "moments": {str(stamp_ns): uri for stamp_ns, uri in drawn.moments.items()},
            "overlays": drawn.overlays,
        },
    }


def _marks(drawn: Thumbnails) -> str:
    """What is drawn over the pictures of each pair, and their height, zipped."""
    marks = {key: one[:2] for key, one in drawn.drawings.items() if one.marks}
    return zipped(json.dumps(marks, ensure_ascii=False, separators=(",", ":")).encode())


def _clouds(made: Clouds) -> View:
    """What a pane draws in 3D, None where there is nothing, and which pairs it lacks."""
    data = {"moments": made.moments, "poses": made.poses, "absent": made.absent}
    return {"lacking": made.lacking, "data": data if made.poses else None}


def _row(pair: PairRow) -> View:
    degrees, centimetres = pair.error or (None, None)
    return {
        "key": pair.key,
        "verdict": pair.verdict,
        "reason": pair.reason,
        "name": pair.verdict if pair.reason == ACCEPTED else spaced(pair.reason),
        "seconds": pair.seconds,
        "labels": ", ".join(pair.labels),
        "score": pair.outcome.evidence.get("score"),
        "odds": pair.outcome.evidence.get("odds"),
        "degrees": degrees,
        "centimetres": centimetres,
    }


def _pane(pair: PairRow, thumbs: Thumbnails) -> View:
    """The text of the pane beside the pictures of a pair, the features in these, and the evidence."""
    evidence = weighed(pair.outcome.evidence, pair.run.least_odds)
    drawn, features = thumbs.drawings.get(pair.key), thumbs.features.get(pair.key)
    return {
        "features": None if features is None else [features.text, features.ends.ravel().tolist()],
        "lacking": _not_shown(drawn),
        "from": str(pair.outcome.from_ns),
        "to": str(pair.outcome.to_ns),
        "meaning": MEANINGS.get(pair.reason, ""),
        "text": pair.text,
        "command": pair_command(pair.run.summary, *pair.seconds) if pair.tried else "",
        "veto": veto_command(pair.run.summary, pair.outcome),
        "evidence": [(row.key, row.value, _rounded(row.weight)) for row in evidence.readings],
        "total": _rounded(evidence.total),
        "least": _rounded(evidence.least),
    }


def _not_shown(drawn: Drawn | None) -> str:
    """Which objects closed a pair and are in neither picture."""
    if drawn is None or not drawn.lacking:
        return ""
    return f"{', '.join(drawn.lacking)}: seen in other frames of the keyframes than these"


def _rounded(weight: float | None) -> float | None:
    return None if weight is None else round(weight, 3)


def _lacking(drawn: Thumbnails, count: int) -> str:
    """Which pairs have no picture, and why; empty where all have one."""
    parts = [f"No picture of {n} of {count}: {why}." for why, n in drawn.lacking.most_common()]
    if drawn.left_out:
        parts.append(f"The pictures of {drawn.left_out} of {count} are left out: the page would grow too large.")
    return " ".join(parts)


def _galleries(pairs: Sequence[PairRow], run: RunSummary, album: Album) -> list[View]:
    """A few accepted and a few refused pairs with their pictures."""
    by_identity = {id(pair.outcome): pair for pair in pairs}
    accepted = [by_identity[id(closure)] for closure in chosen_closures(run)]
    refused = [by_identity[id(refusal)] for refusal in chosen_refusals(run)]
    tried = "Candidates that were tried and refused. Right: the second picture laid over the first by the refused pose."
    both = (
        _gallery("Accepted registrations", OVERLAID, accepted, album),
        _gallery("Refused registrations", tried, refused, album),
    )
    return [gallery for gallery in both if gallery["text"]]


def _gallery(title: str, text: str, chosen: Sequence[PairRow], album: Album) -> View:
    cards = [card for pair in chosen if (card := _card(pair, album))]
    whys = Counter(why for p in chosen if (why := album.lacking(p.outcome.from_ns) or album.lacking(p.outcome.to_ns)))
    reasons = "; ".join(why if count == 1 else f"{why} ({count} times)" for why, count in whys.most_common())
    lacking = f"No picture of {whys.total()} of these {len(chosen)}: {reasons}." if whys else ""
    return {"title": title, "text": " ".join(filter(None, (text if cards else "", lacking))), "cards": cards}


def _card(pair: PairRow, album: Album) -> View | None:
    """Two pictures side by side and over each other; None where the recording lacks a picture."""
    first, second = album.at(pair.outcome.from_ns), album.at(pair.outcome.to_ns)
    if first is None or second is None or first.rgb is None or second.rgb is None:
        return None
    pictures = [(data_uri(rgb), f"{s:.1f} s") for rgb, s in zip((first.rgb, second.rgb), pair.seconds, strict=True)]
    T_from_to = pair.outcome.T_from_to
    over = None if T_from_to is None else data_uri(overlay(first, second, T_from_to))
    drawn = pair_drawing(pair, first, second)
    return {
        **_row(pair),
        "text": pair.text,
        "pictures": pictures,
        "over": over,
        "drawn": drawn,
        "lacking": _not_shown(drawn),
    }


def _objects(run: RunSummary) -> list[View]:
    views = []
    for caption, corrected in {f"By {NAMES.get(run.source, run.source)}": False, "Corrected": True}.items():
        drawing = _in_both_widths(partial(figures.object_map, run, corrected), figures.HALF)
        if drawing is None:
            return []
        views.append({"drawing": drawing, "caption": caption})
    return views


def _stages(run: RunSummary) -> list[View]:
    stages: dict[str, dict[str, float]] = run.summary.get("stage_ms", {})
    longest = max((ms["p95"] for ms in stages.values()), default=1.0) or 1.0
    return [
        {"name": name, **{p: {"ms": ms[p], "width": 100 * ms[p] / longest} for p in ("p50", "p95")}}
        for name, ms in stages.items()
    ]
