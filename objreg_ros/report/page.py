# SPDX-License-Identifier: Apache-2.0
"""The report: one self-contained HTML page that opens offline, in light and in dark."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from html import escape

import numpy as np

from objreg_ros.data import UNTRIED, Array, LoopClosure, Rejected
from objreg_ros.geometry import pose_error, rotation_angle
from objreg_ros.report import figures
from objreg_ros.report.drawing import legend
from objreg_ros.report.pictures import Album, chosen_closures, chosen_refusals, data_uri, overlay
from objreg_ros.report.reasons import MEANINGS
from objreg_ros.report.story import Story, Tracks, of_one_clock
from objreg_ros.report.style import CSS


def page(chapters: Sequence[tuple[Story, Album | None]]) -> str:
    """The HTML of a report, a chapter for each run; one without an album has no pictures."""
    title = ", ".join(story.name for story, _ in chapters)
    body = "".join(_chapter(story, album) for story, album in chapters)
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)} – objreg</title><style>{CSS}</style></head><body><main>{body}"
        "<footer>Written by objreg report. Hover over lines and dots for their numbers.</footer>"
        "</main></body></html>\n"
    )


def _chapter(story: Story, album: Album | None) -> str:
    tracks = story.tracks()
    sections = [
        _head(story, tracks),
        _way(story, tracks),
        _timeline(story),
        _accepted(story, album),
        _refused(story, album),
        _objects(story),
        _timing(story),
    ]
    return f"<article>{''.join(sections)}</article>"


def _head(story: Story, tracks: Tracks | None) -> str:
    false = sum(story.is_false(closure) for closure in story.closures)
    judged = sum(story.error(closure) is not None for closure in story.closures)
    tiles = [
        _tile(f"{story.summary.get('frames', len(story.glimpses)):,}", "frames", _count_note(story)),
        _tile(f"{len(story.closures)}", "constraints", _refused_note(story)),
    ]
    if judged:
        tone = "bad" if false else "good"
        tiles.append(_tile(f"{false}", "false constraints", f"of {judged} that truth can judge", tone))
    if tracks is not None and tracks.odometry_error is not None and tracks.corrected_error is not None:
        before, after = (100 * root_mean_square(e) for e in (tracks.odometry_error, tracks.corrected_error))
        tiles.append(_tile(f"{before:.1f} → {after:.1f} cm", "trajectory error", _change(before, after)))
    said = _verdict(story, false, judged) + (f" Lens: {lens}." if (lens := story.summary.get("lens")) else "")
    return f"<h1>{escape(story.name)}</h1><p>{escape(said)}</p><div class=tiles>{''.join(tiles)}</div>"


def root_mean_square(values: Array) -> float:
    """The root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))


def _tile(value: str, name: str, note: str, tone: str = "") -> str:
    return (
        f'<div class="card tile {tone}"><div class=name>{escape(name)}</div>'
        f"<div class=value>{escape(value)}</div><div class=note>{escape(note)}</div></div>"
    )


def _refused_note(story: Story) -> str:
    """How many candidates were tried in vain, and how many more the table of reasons counts that were not tried."""
    counts = story.summary.get("rejected", {})
    untried = sum(counts.get(reason.value, 0) for reason in UNTRIED)
    tried = f"{sum(counts.values()) - untried} candidates refused"
    return f"{tried}, {untried} more not tried" if untried else tried


def _count_note(story: Story) -> str:
    if "detections" not in story.summary:
        return "with colour and depth"
    return f"{story.summary['detections']:,} detections, {story.summary.get('objects', 0):,} objects"


def _change(before: float, after: float) -> str:
    share = 100 * (1 - after / before) if before > 0 else 0.0
    return f"RMS, {abs(share):.0f} % {'less' if share >= 0 else 'more'} than odometry"


def _verdict(story: Story, false: int, judged: int) -> str:
    if not story.closures:
        return "No loop was closed: nothing in this run was sure enough."
    labels = [label for closure in story.closures for label in closure.labels]
    seen = ", ".join(sorted(set(labels), key=lambda label: -labels.count(label))[:5])
    by = f" by {seen}" if seen else ""
    truth = f"; truth finds {false or 'none'} of them false" if judged else "; there is no truth to judge them by"
    return f"{len(story.closures)} loops closed{by}{truth}."


def _way(story: Story, tracks: Tracks | None) -> str:
    if tracks is None:
        return _section("Trajectory", "There is no odometry in this run, so there is no trajectory to correct.", "")
    entries = [("odometry", "odometry"), ("corrected", "corrected"), ("accepted", "closure")]
    entries = ([("true", "truth")] if tracks.true is not None else []) + entries
    words = "From above. Closures tie places that were seen twice; the pose graph takes the drift out of odometry."
    if story.pruned:
        words += f" The mapper pruned {len(story.pruned)} of {len(story.closures)} closures."
    if story.unsolved:
        words += f" The corrected way is that of odometry here: {escape(story.unsolved)}."
    if story.left_out:
        words += f" {story.left_out} frames are left out: their time is not later than that of the frames before them."
    across = len(story.closures) - len(of_one_clock(story.closures))
    if across:
        words += f" {across} closures are left out: they tie two runs of the clock, and the map is of one."
    drawing = f"<figure class=card>{legend(entries)}{figures.way(story, tracks)}</figure>"
    error = figures.error_over_time(story, tracks)
    if error:
        drawing += f"<figure class=card>{error}<figcaption>Distance from the truth over time.</figcaption></figure>"
    return _section("Trajectory", words, drawing)


def _timeline(story: Story) -> str:
    if not (story.glimpses or story.closures or story.refusals):
        return ""
    entries = [("seen", "detected"), ("accepted", "closure"), ("refused", "refused candidate")]
    if any(story.is_false(closure) for closure in story.closures):
        entries.insert(2, ("false", "false closure"))
    words = "What was detected, which moments were tied together, and what was refused and why."
    if story.out_of_time:
        counts = ", ".join(f"{count} {what}" for what, count in story.out_of_time.items())
        words += f" Left out: {counts}, more than an hour from the longest part of the run; are their stamps right?"
    drawing = f"<figure class=card>{legend(entries)}{figures.timeline(story)}</figure>"
    return _section("Timeline", words, drawing + _reasons(story))


def _reasons(story: Story) -> str:
    counts = story.summary.get("rejected", {})
    if not counts:
        return ""
    examples = {refusal.reason.value: refusal.detail for refusal in reversed(story.refusals)}
    rows = [
        (name.replace("_", " "), f"{count}", MEANINGS.get(name, ""), examples.get(name, ""))
        for name, count in sorted(counts.items(), key=lambda item: -item[1])
    ]
    body = "".join(_reason_row(*row) for row in rows)
    example = "for example" if examples else ""
    head = f"<tr><th>refused because</th><th class=number>times</th><th>meaning</th><th>{example}</th></tr>"
    return f"<div class=card><table>{head}{body}</table></div>"


def _reason_row(name: str, count: str, meaning: str, example: str) -> str:
    return (
        f"<tr><td>{escape(name)}</td><td class=number>{count}</td><td>{escape(meaning)}</td>"
        f"<td class=detail>{escape(example)}</td></tr>"
    )


def _accepted(story: Story, album: Album | None) -> str:
    if album is None:
        return ""
    chosen = chosen_closures(story)
    pairs = [pair for closure in chosen if (pair := _closure_pair(story, closure, album))]
    words = (
        f"{len(pairs)} of {len(story.closures)}. Right: the second moment laid over the first by the "
        "constraint, magenta over green. Grey is agreement, coloured fringes are not; dark was not seen by both."
    )
    return _registrations("Accepted registrations", words, pairs, _lacking(chosen, album))


def _refused(story: Story, album: Album | None) -> str:
    if album is None:
        return ""
    chosen = chosen_refusals(story)
    pairs = [pair for refusal in chosen if (pair := _refusal_pair(story, refusal, album))]
    words = (
        "Candidates that were tried and turned down. Right: the second moment laid over the first by the refused pose."
    )
    return _registrations("Refused registrations", words, pairs, _lacking(chosen, album))


def _registrations(title: str, words: str, pairs: Sequence[str], lacking: str) -> str:
    """A section of pictures and of what has none; empty where there is nothing of either."""
    told = " ".join(part for part in (words if pairs else "", lacking) if part)
    return _section(title, told, "".join(pairs)) if told else ""


def _lacking(chosen: Sequence[LoopClosure | Rejected], album: Album) -> str:
    """How many of the chosen have no picture, and why; empty where all have one."""
    whys = Counter(why for c in chosen if (why := album.lacking(c.from_ns) or album.lacking(c.to_ns)))
    if not whys:
        return ""
    reasons = "; ".join(why if count == 1 else f"{why} ({count} times)" for why, count in whys.most_common())
    return f"No picture of {whys.total()} of these {len(chosen)}: {reasons}."


def _closure_pair(story: Story, closure: LoopClosure, album: Album) -> str:
    kind = figures.verdict(story, closure)
    tag = f'<span class="tag {kind}">{kind}</span>'
    words = tag + escape(figures.closure_words(story, closure))
    return _pair(story, closure, album, words, closure.T_from_to, "laid over each other")


def _refusal_pair(story: Story, refusal: Rejected, album: Album) -> str:
    reason = refusal.reason.value.replace("_", " ")
    detail = f"{refusal.detail}.{_in_truth(story, refusal)}"
    words = f'<span class="tag refused">{escape(reason)}</span>{escape(detail)}'
    return _pair(story, refusal, album, words, refusal.T_from_to, "laid over each other")


def _in_truth(story: Story, refusal: Rejected) -> str:
    """How far the two moments are apart, and by how much the refused pose is wrong; empty without truth."""
    truth = story.truth.between(refusal.from_ns, refusal.to_ns)
    if truth is None:
        return ""
    degrees, metres = np.degrees(rotation_angle(truth[:3, :3])), float(np.linalg.norm(truth[:3, 3]))
    words = f" In truth {degrees:.0f}° and {metres:.1f} m apart"
    if refusal.T_from_to is not None:
        off_degrees, off_cm = pose_error(refusal.T_from_to, truth)
        words += f"; the pose is off by {off_degrees:.0f}° and {off_cm:.0f} cm"
    return words + "."


def _pair(
    story: Story, moments: LoopClosure | Rejected, album: Album, words: str, T_from_to: Array | None, what: str
) -> str:
    """Two moments side by side and over each other; empty where the recording lacks a picture."""
    first, second = album.at(moments.from_ns), album.at(moments.to_ns)
    if first is None or second is None or first.rgb is None or second.rgb is None:
        return ""
    shown = [
        (first.rgb, f"{story.seconds(moments.from_ns):.1f} s"),
        (second.rgb, f"{story.seconds(moments.to_ns):.1f} s"),
    ]
    if T_from_to is not None:
        shown.append((overlay(first, second, T_from_to), what))
    cells = "".join(_picture(np.ascontiguousarray(rgb), name) for rgb, name in shown)
    return f'<div class="card pair"><p class=words>{words}</p><div class=row>{cells}</div></div>'


def _picture(rgb: Array, name: str) -> str:
    return f'<div><img src="{data_uri(rgb)}" alt="{escape(name)}"><div class=what>{escape(name)}</div></div>'


def _objects(story: Story) -> str:
    maps = [(figures.object_map(story, corrected), corrected) for corrected in (False, True)]
    if not all(drawing for drawing, _ in maps):
        return ""
    cards = "".join(
        f"<figure class=card>{drawing}<figcaption>{'Corrected' if corrected else 'By odometry'}</figcaption></figure>"
        for drawing, corrected in maps
    )
    words = "Every sighting of every object from above. One object is one heap where the trajectory is right."
    return _section("Object map", words, f"<div class=two>{cards}</div>")


def _timing(story: Story) -> str:
    stages: dict[str, dict[str, float]] = story.summary.get("stage_ms", {})
    if not stages:
        return ""
    longest = max((ms["p95"] for ms in stages.values()), default=1.0) or 1.0
    body = "".join(_stage_row(stage, ms, longest) for stage, ms in stages.items())
    head = "<tr><th>stage</th><th class=number>median</th><th class=number>95 %</th><th></th></tr>"
    return _section("Time", "Milliseconds a frame.", f"<div class=card><table>{head}{body}</table></div>")


def _stage_row(stage: str, ms: dict[str, float], longest: float) -> str:
    widths = {name: 100 * ms[name] / longest for name in ("p50", "p95")}
    bars = "".join(f'<div class="{name}" style="width:{width:.1f}%"></div>' for name, width in widths.items())
    numbers = "".join(f"<td class=number>{ms[name]:.1f} ms</td>" for name in ("p50", "p95"))
    return f"<tr><td>{escape(stage)}</td>{numbers}<td class=meter>{bars}</td></tr>"


def _section(title: str, words: str, body: str) -> str:
    return f"<section><h2>{escape(title)}</h2><p>{escape(words)}</p>{body}</section>"
