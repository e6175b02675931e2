# SPDX-License-Identifier: Apache-2.0
"""Plots as SVG text. Colours are the page's CSS classes, so one drawing is right in light and in dark."""

from __future__ import annotations

from html import escape

import numpy as np

from objreg_ros.data.checked import Array

LEFT, RIGHT, TOP, BOTTOM = 48, 14, 12, 34
LONGEST_LINE = 800  # points of one polyline; more cannot be seen


class Plot:
    """Axes in data units over a box in pixels; the y of the data points up."""

    def __init__(
        self,
        x_range: tuple[float, float],
        y_range: tuple[float, float],
        width: int = 1040,
        height: int = 320,
        left: int = LEFT,
    ) -> None:
        self.width, self.height, self.left = width, height, left
        self.x_range, self.y_range = x_range, y_range
        self.parts: list[str] = []
        self.hits: list[str] = []  # broad and unseen, above all else: a thin line is hard to point at

    @classmethod
    def equal(cls, xy: Array, width: int = 1040, least: int = 240, most: int = 560) -> Plot:
        """A plot that shows points (N, 2) with the same scale on both axes."""
        low, high = xy.min(axis=0), xy.max(axis=0)
        margin = 0.06 * max(float((high - low).max()), 0.1)
        low, high = low - margin, high + margin
        inner = width - LEFT - RIGHT
        scale = min(inner / (high - low)[0], (most - TOP - BOTTOM) / (high - low)[1])
        height = int(np.clip((high - low)[1] * scale + TOP + BOTTOM, least, most))
        middle = (low + high) / 2
        half = np.array([inner, height - TOP - BOTTOM]) / scale / 2
        (x0, y0), (x1, y1) = middle - half, middle + half
        return cls((x0, x1), (y0, y1), width, height)

    def x(self, value: float) -> float:
        """Pixels from the left."""
        low, high = self.x_range
        return self.left + (value - low) / (high - low) * (self.width - self.left - RIGHT)

    def y(self, value: float) -> float:
        """Pixels from the top."""
        low, high = self.y_range
        return self.height - BOTTOM - (value - low) / (high - low) * (self.height - TOP - BOTTOM)

    def line(self, xy: Array, style: str, title: str = "", pair: str = "") -> None:
        """A line through points (N, 2); one of a ``pair`` opens it."""
        step = max(1, len(xy) // LONGEST_LINE)
        kept = np.concatenate([xy[:-1:step], xy[-1:]])
        points = " ".join(f"{self.x(x):.1f},{self.y(y):.1f}" for x, y in kept)
        self._add_stroke("polyline", f'points="{points}"', style, title, pair)

    def dot(self, x: float, y: float, style: str, title: str = "", radius: float = 3.0, pair: str = "") -> None:
        """A dot; one of a ``pair`` opens it."""
        opens = f' data-pair="{pair}"' if pair else ""
        place = f'cx="{self.x(x):.1f}" cy="{self.y(y):.1f}" r="{radius}"'
        self._add(f'<circle class="dot {style}"{opens} {place}', title)

    def bar(self, x0: float, x1: float, y: float, style: str, title: str = "", thickness: float = 8.0) -> None:
        """A bar from ``x0`` to ``x1``, its middle at ``y``."""
        left, width = self.x(x0), max(self.x(x1) - self.x(x0), 1.0)
        box = f'x="{left:.1f}" y="{self.y(y) - thickness / 2:.1f}" width="{width:.1f}" height="{thickness}"'
        self._add(f'<rect class="dot {style}" {box}', title)

    def arc(self, x0: float, x1: float, y: float, rise: float, style: str, title: str = "", pair: str = "") -> None:
        """A bow over the axis from ``x0`` to ``x1`` at ``y``, ``rise`` px high; one of a ``pair`` opens it."""
        a, b, base = self.x(x0), self.x(x1), self.y(y)
        bow = f"M{a:.1f} {base:.1f} Q{(a + b) / 2:.1f} {base - 2 * rise:.1f} {b:.1f} {base:.1f}"
        self._add_stroke("path", f'd="{bow}"', style, title, pair)

    def text(self, x_px: float, y_px: float, text: str, anchor: str = "start", style: str = "label") -> None:
        """Text at a place in pixels."""
        self.parts.append(
            f'<text class="{style}" x="{x_px:.1f}" y="{y_px:.1f}" text-anchor="{anchor}">{escape(text)}</text>'
        )

    def x_axis(self, unit: str) -> None:
        """Ticks with light vertical lines, and the unit behind the last."""
        for value in ticks(*self.x_range):
            x = self.x(value)
            self.parts.append(f'<line class="grid" x1="{x:.1f}" y1="{TOP}" x2="{x:.1f}" y2="{self.height - BOTTOM}"/>')
            self.text(x, self.height - BOTTOM + 16, f"{value:g}", "middle")
        self.text(self.width - RIGHT, self.height - 4, unit, "end")

    def y_axis(self, unit: str) -> None:
        """Ticks with light horizontal lines, and the unit above."""
        for value in ticks(*self.y_range):
            y = self.y(value)
            self.parts.append(
                f'<line class="grid" x1="{self.left}" y1="{y:.1f}" x2="{self.width - RIGHT}" y2="{y:.1f}"/>'
            )
            self.text(self.left - 8, y + 4, f"{value:g}", "end")
        self.text(4, TOP + 2, unit)

    def svg(self, title: str) -> str:
        """The drawing; ``title`` is for screen readers."""
        return (
            f'<svg viewBox="0 0 {self.width} {self.height}" role="img" aria-label="{escape(title)}">'
            + "".join(self.parts + self.hits)
            + "</svg>"
        )

    def _add_stroke(self, tag: str, shape: str, style: str, title: str, pair: str) -> None:
        if not pair:
            self._add(f'<{tag} class="line {style}" {shape}', title)
            return
        self._add(f'<{tag} class="line {style}" data-of="{pair}" {shape}', "")
        self.hits.append(_closed(f'<{tag} class="hit" data-pair="{pair}" {shape}', title))

    def _add(self, opened: str, title: str) -> None:
        self.parts.append(_closed(opened, title))


def _closed(opened: str, title: str) -> str:
    """An element with its title, which shows where one hovers over it."""
    tag = opened[1 : opened.index(" ")]
    return f"{opened}><title>{escape(title)}</title></{tag}>" if title else f"{opened}/>"


def ticks(low: float, high: float, about: int = 6) -> list[float]:
    """Round values between two bounds, about so many."""
    raw = (high - low) / about
    magnitude = 10.0 ** np.floor(np.log10(raw))
    step = next(m * magnitude for m in (1.0, 2.0, 5.0, 10.0) if m * magnitude >= raw)
    first = np.ceil(low / step)
    count = int(np.floor(high / step) - first) + 1
    return [round(float((first + k) * step), 10) for k in range(count)]
