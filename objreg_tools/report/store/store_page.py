# SPDX-License-Identifier: Apache-2.0
"""A store as a page: sessions from above, its objects with pictures, and what moved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.memory.landmarks import Landmark
from objreg_tools.report.drawing import BOTTOM, Plot
from objreg_tools.report.page import environment
from objreg_tools.report.run.pictures import picture_uri
from objreg_tools.report.store.dot_names import Dot, placed
from objreg_tools.report.store.session_map import MapPlace, SessionMap, session_maps
from objreg_tools.report.store.store_summary import StoreSummary, moves_as_text, vetoes_as_text
from objreg_tools.report.store.tied_map import TiedMap, tied_maps

SERIES = 7  # colours of the page before grey
WIDTHS = {"wide": 540, "narrow": 380}  # px
WIDTHS_TIED = {"wide": 1040, "narrow": 380}  # px, of sessions in one frame
DESCENT = 3  # px below the line of a name
SIDES = {"wide": (300, 480), "narrow": (240, 380)}  # px, the least and the greatest height


def store_page(found: StoreSummary, pictures: Mapping[int, Array]) -> str:
    """The HTML of a store; ``pictures`` are the portraits by landmark, and a landmark may lack one."""
    styles = label_styles(found)
    maps = session_maps(found)
    return environment().get_template("store.html.j2").render(
        found=found,
        moves=moves_as_text(found),
        vetoes=vetoes_as_text(found),
        legend=[(styles[label], f"{label} ({count})") for label, count in found.labels.items()],
        sessions=[
            {**session, "drawing": {name: drawn_alone(one, styles, name) for name in WIDTHS}}
            for session, one in zip(found.sessions, maps, strict=True)
        ],
        tied=[
            {
                "sessions": _listed(one.sessions),
                "ties": len(one.ties),
                "drawing": {name: drawn_together(one, styles, name) for name in WIDTHS_TIED},
            }
            for one in tied_maps(found)
        ],
        objects=[_object(found, mark, pictures) for mark in found.landmarks],
    )  # fmt: skip


def label_styles(found: StoreSummary) -> dict[str, str]:
    """The class of each label, the most frequent first; the last is that of all others."""
    return {label: f"series-{min(k, SERIES)}" for k, label in enumerate(found.labels)}


def drawn_alone(one: SessionMap, styles: Mapping[str, str], width: str) -> str:
    """One session as SVG; ``styles`` are the classes of the labels, ``width`` a name of `WIDTHS`."""
    least, most = SIDES[width]
    plot = Plot.equal(one.points, WIDTHS[width], least, most)
    plot.x_axis(f"{one.axes[0]} [m]")
    plot.y_axis(f"{one.axes[1]} [m]")
    plot.line(one.trajectory, "faint", "camera trajectory")
    for title, stood, stands in one.moves:
        plot.line(np.array([stood, stands]), "false", f"moved: {title}")
        plot.dot(stood[0], stood[1], "refused", f"stood here: {title}", 4.0)
    _draw_places(plot, one.places, styles)
    return plot.svg(f"session {one.session} from above")


def drawn_together(one: TiedMap, styles: Mapping[str, str], width: str) -> str:
    """Tied sessions as SVG; ``width`` is a name of `WIDTHS_TIED`."""
    least, most = SIDES[width]
    plot = Plot.equal(one.points, WIDTHS_TIED[width], least, 2 * most)
    plot.x_axis(f"{one.axes[0]} [m]")
    plot.y_axis(f"{one.axes[1]} [m]")
    for k, (session, path) in enumerate(one.trajectories):
        plot.line(path, f"session-{min(k, SERIES)}", f"camera trajectory of session {session}")
    for earlier, later, here, there in one.ties:
        plot.line(np.array([here, there]), "tie", f"a constraint between sessions {earlier} and {later}")
        plot.dot(here[0], here[1], "tied", f"a constraint between sessions {earlier} and {later}", 2.5)
    _draw_places(plot, one.places, styles)
    return plot.svg(f"sessions {_listed(one.sessions)} in one frame from above")


def _draw_places(plot: Plot, places: Sequence[MapPlace], styles: Mapping[str, str]) -> None:
    """The dots of objects, with the names for which there is a free place; the others show where one hovers."""
    dots = []
    for place in places:
        name, radius = f"{place.label} {place.landmark}", 4.0 + min(place.sightings, 8) / 2
        plot.dot(place.xy[0], place.xy[1], styles[place.label], f"{name}, in {place.sightings} keyframes", radius)
        dots.append(Dot(plot.x(place.xy[0]), plot.y(place.xy[1]), radius, name, place.sightings))
    inner = plot.width, plot.height - BOTTOM
    for dot, box in zip(dots, placed(dots, *inner), strict=True):
        if box is not None:
            plot.text(box.left, box.bottom - DESCENT, dot.name, style="name")


def _object(found: StoreSummary, mark: Landmark, pictures: Mapping[int, Array]) -> dict[str, Any]:
    rows = found.by_landmark[mark.landmark]
    return {
        "landmark": mark.landmark,
        "label": mark.label,
        "picture": picture_uri(pictures[mark.landmark]) if mark.landmark in pictures else "",
        "sightings": mark.sightings,
        "sessions": _listed(sorted({row.session for row in rows})),
        "first": found.moment(rows[0]),
        "last": found.moment(rows[-1]),
        "place": ", ".join(f"{value:.2f}" for value in mark.position),
    }


def _listed(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, numbers))
