# SPDX-License-Identifier: Apache-2.0
"""What the sections of one run show: plain data for the templates."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from objreg_ros.data import UNTRIED
from objreg_ros.report.run import clouds, figures, findings, thumbnails
from objreg_ros.report.run.camera_map import of_one_clock
from objreg_ros.report.run.clouds import Clouds
from objreg_ros.report.run.pairs import ACCEPTED, Pair, pairs_of
from objreg_ros.report.run.pictures import Album, chosen_closures, chosen_refusals, data_uri, overlay
from objreg_ros.report.run.reasons import MEANINGS
from objreg_ros.report.run.run_summary import RunSummary, Tracks
from objreg_ros.report.run.scene import NAMES, scene
from objreg_ros.report.run.thumbnails import Thumbnails
from objreg_ros.report.run.trajectory_error import root_mean_square

View = dict[str, Any]

OVERLAID = (
    "Right: the second picture laid over the first by the constraint, magenta over green. Grey is agreement, coloured "
    "fringes are not; dark was not seen by both."
)


def chapter(story: RunSummary, album: Album | None, runs: int = 1, spatial: bool = True) -> View:
    """Everything that a run's part of a page of so many runs shows; ``spatial`` with what is in 3D."""
    tracks = story.tracks()
    pairs = pairs_of(story)
    drawn = thumbnails.thumbnails(pairs, album, thumbnails.PAGE_BYTES // runs)
    solid = clouds.clouds(pairs, album, clouds.PAGE_BYTES // runs) if spatial else None
    return {
        "name": story.name,
        "said": _said(story),
        "findings": story.summary.get("findings", ()),
        "tiles": _tiles(story, tracks),
        "about": about_rows(story.summary.get("about", {})),
        "way": _way(story, tracks),
        "timeline": _timeline(story),
        "reasons": _reasons(story),
        "pairs": _browser(pairs, drawn, album),
        "clouds": None if solid is None else _clouds(solid),
        "galleries": [] if album is None else _galleries(pairs, story, album),
        "objects": _objects(story),
        "stages": _stages(story),
    }


def spaced(name: str) -> str:
    """The name of a reason as it reads on a page."""
    return name.replace("_", " ")


def judged(story: RunSummary) -> tuple[int, int]:
    """How many constraints are false, and how many truth covers."""
    errors = sum(story.error(closure) is not None for closure in story.closures)
    return sum(map(story.is_false, story.closures)), errors


def about_rows(about: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What a run was made with, line by line; nothing where its JSON lacks it."""
    model = about.get("model") or {}
    rows = {
        "command": about.get("command"),
        "version": " ".join(filter(None, (about.get("version"), about.get("commit")))),
        "date": about.get("date"),
        "recording": about.get("recording"),
        "model": f"{model.get('name')} (sha256 {model.get('sha256')}…)" if model else "",
        "not the defaults": ", ".join(f"{name} = {value}" for name, value in about.get("params", {}).items()),
    }
    return [(name, str(text)) for name, text in rows.items() if text]


def _said(story: RunSummary) -> str:
    said = _verdict(story)
    return f"{said} Lens: {lens}." if (lens := story.summary.get("lens")) else said


def _verdict(story: RunSummary) -> str:
    if not story.closures:
        sure = "" if story.summary.get("findings") or not story.refusals else ": no candidate was certain enough"
        return f"No loop was closed{sure}."
    labels = [label for closure in story.closures for label in closure.labels]
    seen = ", ".join(sorted(set(labels), key=lambda label: -labels.count(label))[:5])
    by = f" by {seen}" if seen else ""
    false, of = judged(story)
    truth = f"; truth finds {false or 'none'} of them false" if of else "; there is no truth to judge them by"
    return f"{findings.number_of(len(story.closures), 'loop')} closed{by}{truth}."


def _tiles(story: RunSummary, tracks: Tracks | None) -> list[View]:
    false, of = judged(story)
    tiles = [
        _tile(f"{story.summary.get('frames', len(story.glimpses)):,}", "frames", _count_note(story)),
        _tile(f"{len(story.closures)}", "constraints", _refused_note(story)),
    ]
    if of:
        tiles.append(
            _tile(f"{false}", "false constraints", f"of {of} that truth can judge", "bad" if false else "good")
        )
    if tracks is not None and tracks.odometry_error is not None and tracks.corrected_error is not None:
        before, after = (100 * root_mean_square(e) for e in (tracks.odometry_error, tracks.corrected_error))
        tiles.append(_tile(f"{before:.1f} → {after:.1f} cm", "trajectory error", _change(before, after, tracks.source)))
    return tiles


def _tile(value: str, name: str, note: str, tone: str = "") -> View:
    return {"value": value, "name": name, "note": note, "tone": tone}


def _refused_note(story: RunSummary) -> str:
    """How many candidates were refused, and how many more in the table of reasons were not tried."""
    counts = story.summary.get("rejected", {})
    untried = sum(counts.get(reason.value, 0) for reason in UNTRIED)
    tried = f"{sum(counts.values()) - untried} candidates refused"
    return f"{tried}, {untried} more not tried" if untried else tried


def _count_note(story: RunSummary) -> str:
    if "detections" not in story.summary:
        return "with colour and depth"
    return f"{story.summary['detections']:,} detections, {story.summary.get('objects', 0):,} objects"


def _change(before: float, after: float, source: str) -> str:
    share = 100 * (1 - after / before) if before > 0 else 0.0
    return f"RMS, {abs(share):.0f} % {'less' if share >= 0 else 'more'} than {NAMES.get(source, source)}"


def _way(story: RunSummary, tracks: Tracks | None) -> View:
    """The drawings of the trajectory; of the truth without odometry, and of our own tracking without either."""
    if tracks is not None:
        stamps_ns, lines, text = tracks.stamps_ns, tracks.lines, _trajectory_words(story)
    elif (true := story.true_trajectory()) is not None:
        stamps_ns, lines = true[0], {"true": true[1]}
        text = "From above. There is no odometry in this run: the trajectory is the ground truth, and is not corrected."
    elif (tracked := story.tracked_trajectory()) is not None:
        stamps_ns, lines = tracked[0], {"tracked": tracked[1][:, :3, 3]}
        text = (
            "From above. There is neither odometry nor ground truth in this run: the trajectory is our own tracking's, "
            f"in its longest stretch, {len(stamps_ns)} of {len(story.glimpses)} frames, and is not corrected."
        )
    else:
        text = "There is neither odometry nor ground truth in this run, and no track of the camera: no trajectory."
        return {"words": text, "legend": [], "drawing": None, "error": None, "scene": None}
    names = {**NAMES, "accepted": "closure"}
    marks = [*lines, *sorted({figures.verdict(story, closure) for closure in story.closures})]
    return {
        "words": text,
        "legend": [(mark, names.get(mark, "false closure" if mark == "false" else mark)) for mark in marks],
        "drawing": _in_both_widths(lambda width: figures.way(story, stamps_ns, lines, width)),
        "scene": scene(story, stamps_ns, lines, tracks),
        "error": None if tracks is None else _in_both_widths(lambda w: figures.error_over_time(story, tracks, w)),
    }


def _in_both_widths(draw: Callable[[int], str], wide: int = figures.WIDE) -> View | None:
    """A drawing for a page and for a telephone; None where there is nothing to draw."""
    drawn = draw(wide)
    return {"wide": drawn, "narrow": draw(figures.NARROW)} if drawn else None


def _trajectory_words(story: RunSummary) -> str:
    source = NAMES.get(story.source, story.source)
    text = f"From above. Closures tie places that were seen twice; the pose graph takes the drift out of {source}."
    if story.by_tracking:
        text += f" {_pieces(story)}"
    if story.pruned:
        text += f" The mapper pruned {len(story.pruned)} of {len(story.closures)} closures."
    if story.map.unsolved:
        text += f" The corrected trajectory is that of {source} here: {story.map.unsolved}."
    if story.left_out:
        text += f" {story.left_out} frames are left out: their time is not later than that of the frames before them."
    across = len(story.closures) - len(of_one_clock(story.closures))
    if across:
        text += f" {across} closures are left out: they tie two runs of the clock, and the map is of one."
    return text


def _pieces(story: RunSummary) -> str:
    """What of our own tracking is drawn."""
    known = story.map
    text = f"There is no odometry in this run: {len(known.frames)} of {len(story.glimpses)} frames are drawn, which "
    text += f"closures tie out of {known.sessions} sessions." if known.sessions > 1 else "are of one session."
    if not known.sessions_apart:
        return text
    return f"{text} {known.frames_apart} frames in {known.sessions_apart} more sessions are not: nothing ties them."


def _timeline(story: RunSummary) -> View | None:
    if not (story.glimpses or story.closures or story.refusals):
        return None
    entries = [("seen", "detected"), ("accepted", "closure"), ("refused", "refused candidate")]
    if any(map(story.is_false, story.closures)):
        entries.insert(2, ("false", "false closure"))
    text = "What was detected, which keyframes were tied together, and what was refused and why."
    if story.out_of_time:
        counts = ", ".join(f"{count} {what}" for what, count in story.out_of_time.items())
        text += f" Left out: {counts}, more than an hour from the longest part of the run; are their stamps right?"
    drawing = _in_both_widths(lambda width: figures.timeline(story, width))
    return {"words": text, "legend": entries, "drawing": drawing}


def _reasons(story: RunSummary) -> list[View]:
    counts = story.summary.get("rejected", {})
    examples = {refusal.reason.value: refusal.detail for refusal in reversed(story.refusals)}
    return [
        {"name": spaced(name), "count": count, "meaning": MEANINGS.get(name, ""), "example": examples.get(name, "")}
        for name, count in sorted(counts.items(), key=lambda item: -item[1])
    ]


def _browser(pairs: Sequence[Pair], drawn: Thumbnails, album: Album | None) -> View:
    """The table of all pairs, what its pictures lack, and what a pane shows of each."""
    counts = Counter(pair.reason for pair in pairs)
    return {
        "rows": [_row(pair) for pair in pairs],
        "filters": [(name, spaced(name), count) for name, count in counts.most_common()],
        "false": sum(pair.verdict == "false" for pair in pairs),
        "lacking": _lacking(drawn, len(pairs)) if album is not None else "There are no pictures of this run.",
        "data": {
            "pairs": {pair.key: _pane(pair) for pair in pairs},
            "moments": {str(stamp_ns): uri for stamp_ns, uri in drawn.moments.items()},
            "overlays": drawn.overlays,
        },
    }


def _clouds(made: Clouds) -> View:
    """What a pane draws in 3D, None where there is nothing, and which pairs it lacks."""
    data = {"moments": made.moments, "poses": made.poses, "absent": made.absent}
    return {"lacking": made.lacking, "data": data if made.poses else None}


def _row(pair: Pair) -> View:
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


def _pane(pair: Pair) -> View:
    """The text of the pane beside the pictures of a pair."""
    return {
        "from": str(pair.outcome.from_ns),
        "to": str(pair.outcome.to_ns),
        "meaning": MEANINGS.get(pair.reason, ""),
        "words": pair.words,
        "evidence": [
            (name, f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.4g}")
            for name, value in pair.outcome.evidence.items()
        ],
    }


def _lacking(drawn: Thumbnails, count: int) -> str:
    """Which pairs have no picture, and why; empty where all have one."""
    parts = [f"No picture of {n} of {count}: {why}." for why, n in drawn.lacking.most_common()]
    if drawn.left_out:
        parts.append(f"The pictures of {drawn.left_out} of {count} are left out: the page would grow too large.")
    return " ".join(parts)


def _galleries(pairs: Sequence[Pair], story: RunSummary, album: Album) -> list[View]:
    """A few accepted and a few refused pairs with their pictures."""
    by_identity = {id(pair.outcome): pair for pair in pairs}
    accepted = [by_identity[id(closure)] for closure in chosen_closures(story)]
    refused = [by_identity[id(refusal)] for refusal in chosen_refusals(story)]
    tried = "Candidates that were tried and refused. Right: the second picture laid over the first by the refused pose."
    both = (
        _gallery("Accepted registrations", OVERLAID, accepted, album),
        _gallery("Refused registrations", tried, refused, album),
    )
    return [gallery for gallery in both if gallery["words"]]


def _gallery(title: str, text: str, chosen: Sequence[Pair], album: Album) -> View:
    cards = [card for pair in chosen if (card := _card(pair, album))]
    whys = Counter(why for p in chosen if (why := album.lacking(p.outcome.from_ns) or album.lacking(p.outcome.to_ns)))
    reasons = "; ".join(why if count == 1 else f"{why} ({count} times)" for why, count in whys.most_common())
    lacking = f"No picture of {whys.total()} of these {len(chosen)}: {reasons}." if whys else ""
    return {"title": title, "words": " ".join(filter(None, (text if cards else "", lacking))), "cards": cards}


def _card(pair: Pair, album: Album) -> View | None:
    """Two pictures side by side and over each other; None where the recording lacks a picture."""
    first, second = album.at(pair.outcome.from_ns), album.at(pair.outcome.to_ns)
    if first is None or second is None or first.rgb is None or second.rgb is None:
        return None
    pictures = [(data_uri(rgb), f"{s:.1f} s") for rgb, s in zip((first.rgb, second.rgb), pair.seconds, strict=True)]
    if pair.outcome.T_from_to is not None:
        pictures.append((data_uri(overlay(first, second, pair.outcome.T_from_to)), "laid over each other"))
    return {**_row(pair), "words": pair.words, "pictures": pictures}


def _objects(story: RunSummary) -> list[View]:
    views = []
    for caption, corrected in {f"By {NAMES.get(story.source, story.source)}": False, "Corrected": True}.items():
        drawing = _in_both_widths(partial(figures.object_map, story, corrected), figures.HALF)
        if drawing is None:
            return []
        views.append({"drawing": drawing, "caption": caption})
    return views


def _stages(story: RunSummary) -> list[View]:
    stages: dict[str, dict[str, float]] = story.summary.get("stage_ms", {})
    longest = max((ms["p95"] for ms in stages.values()), default=1.0) or 1.0
    return [
        {"name": name, **{p: {"ms": ms[p], "width": 100 * ms[p] / longest} for p in ("p50", "p95")}}
        for name, ms in stages.items()
    ]
