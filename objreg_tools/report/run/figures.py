# SPDX-License-Identifier: Apache-2.0
"""The figures of a report: the trajectory, its error over time, the timeline, the object map."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.spatial import cKDTree

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_tools.report.drawing import Plot
from objreg_tools.report.run.run_summary import RunSummary, Tracks

WIDE, HALF, NARROW = 1040, 510, 400  # px of a drawing across the page, across half of it, and on a telephone
LANE = 18  # px of one row of the timeline
MOST_LABELS = 9  # rows of detections; the rarer labels share one more
LINE, LETTER = 13.0, 7.0  # px of a line of text and of a letter
SERIES = 8  # colours of labels on the page
CLUSTER_RADIUS = 0.5  # m around a place that is named on the map
CLUSTER_SIGHTINGS = 4  # of one label there, at least


class GroundAxes:
    """The plane in which a trajectory is drawn: the two directions in which it extends the most."""

    def __init__(self, xyz: Array) -> None:
        self.middle = xyz.mean(axis=0)
        axes = np.linalg.svd(xyz - self.middle, full_matrices=len(xyz) < 3)[2][:2]  # full: all axes, and (N, N) besides
        self.axes = axes * np.where(axes[np.arange(2), np.abs(axes).argmax(axis=1)] < 0, -1.0, 1.0)[:, None]

    def flat(self, xyz: Array) -> Array:
        """(N, 2) of (N, 3)."""
        return (xyz - self.middle) @ self.axes.T


def trajectory(run: RunSummary, stamps_ns: Array, lines: Mapping[str, Array], width: int = WIDE) -> str:
    """Trajectories (N, 3) by CSS class from above, at stamps (N,), and the closures as links on the last of them."""
    ground = GroundAxes(next(iter(lines.values())) if "true" in lines else list(lines.values())[-1])
    flat = {name: ground.flat(xyz) for name, xyz in lines.items()}
    plot = Plot.equal(np.concatenate(list(flat.values())), width)
    plot.x_axis("m")
    plot.y_axis("m")
    for name, xy in flat.items():
        plot.line(xy, name, name)
    main = list(flat.values())[-1]
    for k, closure in enumerate(run.closures):
        plot.line(ends(closure, stamps_ns, main), f"link {verdict(run, closure)}", closure_text(run, closure), f"c{k}")
    x, y = main[0]
    plot.dot(x, y, "start", "start", radius=4)
    plot.text(plot.x(x) + 8, plot.y(y) - 6, "start")
    return plot.svg("the camera trajectory from above: " + ", ".join(lines))


def error_over_time(run: RunSummary, tracks: Tracks, width: int = WIDE) -> str:
    """The distance from the truth, before and after."""
    if tracks.odometry_error is None or tracks.corrected_error is None:
        return ""
    shown = np.array([run.in_time(int(stamp)) for stamp in tracks.stamps_ns])
    if not shown.any():
        return ""
    times = (tracks.stamps_ns[shown] - run.start_ns) * 1e-9
    errors = {tracks.source: 100 * tracks.odometry_error[shown], "corrected": 100 * tracks.corrected_error[shown]}
    top = max(float(error.max()) for error in errors.values())
    plot = Plot((float(times[0]), float(times[-1]) + 1e-9), (0.0, 1.08 * max(top, 1.0)), width, height=220)
    plot.x_axis("s")
    plot.y_axis("cm")
    for name, error in errors.items():
        plot.line(np.column_stack([times, error]), name, name)
    return plot.svg("the distance from the truth over time, before and after")


def timeline(run: RunSummary, width: int = WIDE) -> str:
    """Rows over time: detections by label, closures as bows, refusals by reason; without what is `out_of_time`."""
    names = [label for label, _ in Counter(label for g in run.glimpses for label in g.labels).most_common()]
    labels, rare = names[:MOST_LABELS], names[MOST_LABELS:]
    reasons = [reason for reason, _ in Counter(refusal.reason for refusal in run.refusals).most_common()]
    rows = [*labels, *(["other labels"] if rare else []), "closures", *(reason.value for reason in reasons)]
    heights = {name: 3 * LANE if name == "closures" else LANE for name in rows}
    level = dict(zip(rows, np.cumsum(list(heights.values())) - LANE / 2, strict=True))
    total = sum(heights.values())
    end = max((run.seconds(stamp_ns) for stamp_ns in _stamps_ns(run)), default=1.0)
    plot = Plot((0.0, end + 1e-9), (-float(total), 0.0), width, height=total + 46, left=150)
    plot.x_axis("s")
    for name in rows:
        plot.text(plot.left - 8, plot.y(-level[name]) + 4, name.replace("_", " "), "end")
    row_of = {name: level.get(name, level.get("other labels", 0.0)) for name in names}
    _draw_detections(plot, run, row_of)
    _draw_closures(plot, run, level["closures"])
    for k, refusal in enumerate(run.refusals):
        if not run.in_time(refusal.to_ns):
            continue
        text = f"{refusal.detail} ({run.seconds(refusal.from_ns):.1f} s, {run.seconds(refusal.to_ns):.1f} s)"
        plot.dot(run.seconds(refusal.to_ns), -level[refusal.reason.value], "refused", text, pair=f"r{k}")
    return plot.svg("detections, closures and refusals over time")


def object_map(run: RunSummary, corrected: bool, width: int = HALF) -> str:
    """Every sighting of an object from above, before or in the corrected map, and the camera's trajectory."""
    seen = run.objects()
    places = [row[2] for row in seen]
    tracks = run.tracks()
    if tracks is None or not seen:
        return ""
    _, odometry, poses = run.poses_before_and_after()
    ground = GroundAxes(np.array([T[:3, 3] for T in poses]))
    line = poses if corrected else odometry
    xy = ground.flat(np.array([row[2 if corrected else 1] for row in seen]))
    both = np.concatenate([ground.flat(np.array(places)), ground.flat(np.array([row[1] for row in seen]))])
    plot = Plot.equal(np.concatenate([both, ground.flat(np.array([T[:3, 3] for T in poses]))]), width, most=440)
    plot.x_axis("m")
    plot.y_axis("m")
    plot.line(ground.flat(np.array([T[:3, 3] for T in line])), "faint")
    order = [label for label, _ in Counter(row[0] for row in seen).most_common()]
    for (label, *_), (x, y) in zip(seen, xy, strict=True):
        plot.dot(x, y, f"series-{min(order.index(label), SERIES - 1)}", label, radius=2.2)
    names = clusters([row[0] for row in seen], xy)
    for label, (x_px, y_px) in apart([(label, (plot.x(x), plot.y(y) - 8)) for label, (x, y) in names]):
        plot.text(x_px, y_px, label, "middle", "name")
    return plot.svg("objects from above" + (", corrected" if corrected else ", before it is corrected"))


def clusters(labels: Sequence[str], xy: Array) -> list[tuple[str, Array]]:
    """(label, middle) of the places where one label was seen `CLUSTER_SIGHTINGS` times, for names on the map."""
    found: list[tuple[str, Array]] = []
    for label in dict.fromkeys(labels):
        rest = xy[[name == label for name in labels]]
        while len(rest) >= CLUSTER_SIGHTINGS:
            beside = cKDTree(rest).query_ball_point(rest, CLUSTER_RADIUS, return_length=True)
            near = np.linalg.norm(rest - rest[beside.argmax()], axis=1) < CLUSTER_RADIUS
            if near.sum() < CLUSTER_SIGHTINGS:
                break
            found.append((label, rest[near].mean(axis=0)))
            rest = rest[np.linalg.norm(rest - rest[near].mean(axis=0), axis=1) > CLUSTER_RADIUS]
    return found


def apart(names: Sequence[tuple[str, tuple[float, float]]]) -> list[tuple[str, tuple[float, float]]]:
    """Names at pixels, each moved up until it covers none that is below it."""
    placed: list[tuple[str, tuple[float, float]]] = []
    for label, (x, y) in sorted(names, key=lambda item: -item[1][1]):
        while any(
            abs(y - other_y) < LINE and abs(x - other_x) < LETTER * (len(label) + len(other)) / 2
            for other, (other_x, other_y) in placed
        ):
            y -= 1.0
        placed.append((label, (x, y)))
    return placed


def verdict(run: RunSummary, closure: LoopClosure) -> str:
    """The CSS class of a closure."""
    return "false" if run.is_false(closure) else "accepted"


def ends(closure: LoopClosure, stamps_ns: Array, trajectory: Array) -> Array:
    """Where both keyframes of a closure are on a trajectory (N, D) at stamps (N,): (2, D)."""
    return np.array([trajectory[np.abs(stamps_ns - stamp).argmin()] for stamp in (closure.from_ns, closure.to_ns)])


def closure_text(run: RunSummary, closure: LoopClosure) -> str:
    """A closure in one line."""
    times = f"{run.seconds(closure.from_ns):.1f} s ↔ {run.seconds(closure.to_ns):.1f} s"
    error = run.error(closure)
    truth = [] if error is None else [f"off by {error[0]:.1f}° and {error[1]:.1f} cm"]
    moved = [f"{label} moved by {metres:.2f} m" for label, metres in closure.moved.items()]
    return ", ".join([times, *closure.labels, *moved, *truth])


def _stamps_ns(run: RunSummary) -> list[int]:
    stamps_ns = [glimpse.stamp_ns for glimpse in run.glimpses]
    stamps_ns += [c.to_ns for c in run.closures] + [r.to_ns for r in run.refusals]
    return [stamp_ns for stamp_ns in stamps_ns if run.in_time(stamp_ns)]


def _draw_detections(plot: Plot, run: RunSummary, level: dict[str, float]) -> None:
    """A bar for every stretch of frames in which a label was detected."""
    glimpses = [glimpse for glimpse in run.glimpses if run.in_time(glimpse.stamp_ns)]
    stamps = [glimpse.stamp_ns for glimpse in glimpses]
    pause = 2.5 * float(np.median(np.diff(stamps))) if len(stamps) > 1 else 0.0
    for label, row in level.items():
        seen = np.array([g.stamp_ns for g in glimpses if label in g.labels], np.int64)
        for stretch in np.split(seen, np.flatnonzero(np.diff(seen) > pause) + 1) if len(seen) else ():
            times = [run.seconds(int(stretch[i])) for i in (0, -1)]
            plot.bar(times[0], times[1], -row, "seen", f"{label}, {times[0]:.1f} to {times[1]:.1f} s")


def _draw_closures(plot: Plot, run: RunSummary, row: float) -> None:
    closures = [(k, closure) for k, closure in enumerate(run.closures) if run.in_time(closure.to_ns)]
    longest = max((abs(c.to_ns - c.from_ns) for _, c in closures if run.in_time(c.from_ns)), default=1)
    for k, closure in closures:
        start, end = sorted(run.seconds(stamp) for stamp in (closure.from_ns, closure.to_ns))
        rise = 2.4 * LANE * min(abs(closure.to_ns - closure.from_ns) / longest, 1.0)
        style = verdict(run, closure)
        plot.arc(start, end, -row, rise, style, closure_text(run, closure), f"c{k}")
        for seconds in (start, end):
            plot.dot(seconds, -row, style, closure_text(run, closure), 2.5, f"c{k}")
