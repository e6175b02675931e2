# SPDX-License-Identifier: Apache-2.0
"""A store as one picture: a panel with axes for each session, and below them its objects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.memory.landmarks import Landmark
from objreg_tools.report.drawing import ticks
from objreg_tools.report.store.portraits import TILE
from objreg_tools.report.store.session_map import MapPlace, SessionMap, session_maps
from objreg_tools.report.store.store_summary import StoreSummary

PANEL = 640  # px of a session
LEAST_PANEL = 320  # where there are many
TALLEST = 16_000  # px of all panels
LEFT, RIGHT, TOP, BOTTOM = 56, 24, 40, 48
CAPTION = 36  # px below a picture of an object
INK, FAINT, RULE, TRAJECTORY, MOVED = (40, 40, 40), (120, 120, 120), (228, 228, 228), (165, 165, 165), (208, 59, 59)
COLOURS = (
    (42, 120, 214), (27, 175, 122), (201, 133, 0), (208, 59, 59), (74, 58, 167), (213, 81, 129),
    (0, 131, 0), (53, 151, 143), (140, 81, 10), (90, 90, 90), (150, 190, 60), (118, 42, 131),
)  # fmt: skip
FONT, SMALL, PLAIN = cv2.FONT_HERSHEY_SIMPLEX, 0.4, 0.45

Colour = tuple[int, int, int]


def draw(found: StoreSummary, pictures: Mapping[int, Array]) -> Array:
    """A picture (H, W, 3) uint8 RGB of a store: every session from above, in m, then a contact sheet of its objects.

    ``pictures`` are the portraits by landmark; a landmark without one is not on the sheet. Dots are landmarks, larger
    the more often they were seen. The line is the camera's trajectory. An arrow begins where a moved object stood.
    """
    maps = session_maps(found)
    if not maps:
        return _titled(PANEL, PANEL, "an empty store")
    colours = colours_of(list(found.labels))
    panels = _laid_out(maps, colours)
    sheet = _contact_sheet([mark for mark in found.landmarks if mark.landmark in pictures], pictures, panels.shape[1])
    return np.vstack([panels, _legend(found.labels, colours, panels.shape[1]), sheet])


def colours_of(labels: Sequence[str]) -> dict[str, Colour]:
    """A colour for each label; the thirteenth has the first again."""
    return {label: COLOURS[k % len(COLOURS)] for k, label in enumerate(labels)}


def _laid_out(maps: Sequence[SessionMap], colours: Mapping[str, Colour]) -> Array:
    """The panels in rows of two, or as many as keep the picture below `TALLEST`."""
    columns = min(len(maps), 2)
    while -(-len(maps) // columns) * _side(columns) > TALLEST:
        columns += 1
    side = _side(columns)
    panels = [_panel(one, side, colours) for one in maps]
    panels += [_blank(side, side)] * (-len(panels) % columns)
    return np.vstack([np.hstack(panels[k : k + columns]) for k in range(0, len(panels), columns)])


def _side(columns: int) -> int:
    return max(LEAST_PANEL, PANEL * 2 // max(columns, 2))


def _panel(one: SessionMap, side: int, colours: Mapping[str, Colour]) -> Array:
    sheet = _titled(side, side, f"session {one.session}: {len(one.places)} objects")
    scale, low = _fitted(one.points, side)
    _draw_axes(sheet, one.axes, scale, low)

    def pixels(xy: Array) -> Array:
        flat = (xy - low) * scale * (1, -1) + (LEFT, side - BOTTOM)
        return np.asarray(np.rint(flat), np.int32)

    cv2.polylines(sheet, [pixels(one.trajectory)[:, None]], False, TRAJECTORY, 2, cv2.LINE_AA)
    for place in one.places:
        cv2.circle(sheet, pixels(place.xy).tolist(), _radius(place), colours[place.label], -1, cv2.LINE_AA)
    for _, stood, stands in one.moves:
        _draw_move(sheet, pixels(stood).tolist(), pixels(stands).tolist())
    _name(sheet, {place: pixels(place.xy).tolist() for place in one.places})
    return sheet


def _fitted(points: Array, side: int) -> tuple[float, Array]:
    """Pixels of a metre, and the point in m of the lower left corner, so that all points are within the axes."""
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.08 * max(float((high - low).max()), 0.5)
    inner = np.array([side - LEFT - RIGHT, side - TOP - BOTTOM])
    scale = float((inner / (high - low + 2 * margin)).min())
    return scale, (low + high) / 2 - inner / scale / 2


def _draw_axes(sheet: Array, axes: tuple[str, str], scale: float, low: Array) -> None:
    side = len(sheet)
    right, base = side - RIGHT, side - BOTTOM
    far = low + np.array([right - LEFT, base - TOP]) / scale
    for value in ticks(low[0], far[0]):
        x = round(LEFT + (value - low[0]) * scale)
        cv2.line(sheet, (x, TOP), (x, base), RULE, 1)
        _write(sheet, f"{value:g}", (x - 8, base + 16), FAINT)
    for value in ticks(low[1], far[1]):
        y = round(base - (value - low[1]) * scale)
        cv2.line(sheet, (LEFT, y), (right, y), RULE, 1)
        _write(sheet, f"{value:g}", (16, y + 4), FAINT)
    _write(sheet, f"{axes[0]} [m]", (right - 36, base + 36), INK)
    _write(sheet, f"{axes[1]} [m]", (8, TOP - 6), INK)


def _radius(place: MapPlace) -> int:
    return 3 + min(place.sightings, 10) // 2


def _draw_move(sheet: Array, stood: list[int], stands: list[int]) -> None:
    """An arrow from a ring."""
    cv2.circle(sheet, stood, 9, MOVED, 2, cv2.LINE_AA)
    cv2.arrowedLine(sheet, stood, stands, MOVED, 2, cv2.LINE_AA, tipLength=0.3)


def _name(sheet: Array, at: Mapping[MapPlace, list[int]]) -> None:
    """The ids beside the dots, those that were seen most first; one that would lie upon another is left out."""
    taken = np.zeros(sheet.shape[:2], bool)
    for place in sorted(at, key=lambda place: -place.sightings):
        text, (x, y) = str(place.landmark), at[place]
        (width, height), _ = cv2.getTextSize(text, FONT, SMALL, 1)
        left, base = x + _radius(place) + 2, y + height // 2
        box = np.s_[base - height - 1 : base + 2, left : left + width]
        if not taken[box].any():
            taken[box] = True
            _write(sheet, text, (left, base), INK)


def _legend(counts: Mapping[str, int], colours: Mapping[str, Colour], width: int) -> Array:
    """The labels with their colours and how often each was seen, in as many rows as they need."""
    rows, x = [_blank(24, width)], 16
    for label, count in counts.items():
        text = f"{label} {count}"
        wide = cv2.getTextSize(text, FONT, SMALL, 1)[0][0] + 40
        if x + wide > width:
            rows.append(_blank(24, width))
            x = 16
        cv2.circle(rows[-1], (x, 12), 5, colours[label], -1, cv2.LINE_AA)
        _write(rows[-1], text, (x + 10, 16), INK)
        x += wide
    return np.vstack(rows)


def _contact_sheet(marks: Sequence[Landmark], pictures: Mapping[int, Array], width: int) -> Array:
    """The pictures of objects in rows, each with its name, id and how many keyframes show it."""
    columns = max(1, width // TILE)
    tiles = [_captioned(pictures[mark.landmark], mark) for mark in marks]
    tiles += [_blank(TILE + CAPTION, TILE)] * (-len(tiles) % columns)
    rows = [np.hstack(tiles[k : k + columns]) for k in range(0, len(tiles), columns)]
    padded = [np.hstack([row, _blank(len(row), width - row.shape[1])]) for row in rows]
    return np.vstack([_titled(TOP, width, f"{len(marks)} objects"), *padded])


def _captioned(picture: Array, mark: Landmark) -> Array:
    caption = _blank(CAPTION, TILE)
    _write(caption, f"{mark.label} {mark.landmark}", (4, 14), INK)
    _write(caption, f"in {mark.sightings} keyframes", (4, 28), FAINT)
    framed = cv2.copyMakeBorder(picture[2:-2, 2:-2], 2, 2, 2, 2, cv2.BORDER_CONSTANT, value=(255, 255, 255))
    return np.vstack([framed, caption])


def _blank(height: int, width: int) -> Array:
    return np.full((height, width, 3), 255, np.uint8)


def _titled(height: int, width: int, title: str) -> Array:
    sheet = _blank(height, width)
    cv2.putText(sheet, title, (12, 20), FONT, PLAIN, INK, 1, cv2.LINE_AA)
    return sheet


def _write(sheet: Array, text: str, at: tuple[int, int], colour: Colour) -> None:
    cv2.putText(sheet, text, at, FONT, SMALL, colour, 1, cv2.LINE_AA)
