# SPDX-License-Identifier: Apache-2.0
"""The curves of a sweep: recall against false constraints, both against a parameter, constraints against their odds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from objreg_tools.report.drawing import Plot
from objreg_tools.report.run.figures import SERIES, WIDE
from objreg_tools.report.sweep.sweep_rows import Setting, front_of, shown

HEIGHT = 320  # px
LEAST_FALSE = 5  # false constraints that the axis shows at least, so that its ticks are whole numbers
COLOURS, REST = SERIES - 1, "faint"  # the last colour of labels is grey, as the rest


def styles_of(order: Sequence[Setting]) -> dict[int, str]:
    """The CSS class of each combination by its identity: a colour for the first `COLOURS`, faint for the rest."""
    return {id(one): f"series-{k}" if k < COLOURS else REST for k, one in enumerate(order)}


def recall_against_false(order: Sequence[Setting], width: int = WIDE) -> str:
    """A dot for each combination, the best first in ``order``; a line through those that none beats."""
    judged = [one for one in order if one.recall is not None]
    if not judged:
        return ""
    most = max(LEAST_FALSE, *(one.total("false") for one in judged))
    plot = Plot((-0.05 * most, 1.1 * most), (0.0, 105.0), width, HEIGHT)
    plot.x_axis("false constraints")
    plot.y_axis("revisits closed, %")
    plot.line(
        np.array([(one.total("false"), _percent(one)) for one in front_of(judged)]), "corrected", "none is better"
    )
    styles = styles_of(order)
    for one in reversed(judged):
        plot.dot(one.total("false"), _percent(one), styles[id(one)], _title(one), 5.0)
    return plot.svg("revisits closed against false constraints, a dot for each combination")


def constraints_against_odds(order: Sequence[Setting], width: int = WIDE) -> str:
    """For each combination how many constraints have at least such odds."""
    known = [one for one in order if one.odds]
    if not known:
        return ""
    logs = {id(one): np.log10(np.maximum(one.odds, 1.0)) for one in known}
    low = min(float(log.min()) for log in logs.values())
    high = max(float(log.max()) for log in logs.values())
    most = max(len(one.odds) for one in known)
    plot = Plot((np.floor(low), max(np.ceil(high), np.floor(low) + 1)), (0.0, 1.05 * most), width, HEIGHT)
    plot.x_axis("least odds, as a power of 10")
    plot.y_axis("constraints")
    styles = styles_of(order)
    for one in reversed(known):
        log = logs[id(one)]
        line = np.stack([np.append(log, low), np.append(np.arange(1, len(log) + 1), len(log))], axis=1)
        plot.line(line, styles[id(one)], f"{one.text}: {len(one.odds)} constraints")
    return plot.svg("how many constraints have at least such odds, a line for each combination")


def against_parameters(settings: Sequence[Setting], width: int = WIDE) -> Iterator[dict[str, Any]]:
    """For each parameter of several values: the least, the mean and the most of the combinations with each value."""
    for name in settings[0].values if settings else ():
        values = list({shown(one.values[name]): None for one in settings})
        yield {"name": name, "svg": _against(settings, name, values, width)}


def _against(settings: Sequence[Setting], name: str, values: Sequence[str], width: int) -> str:
    measures = [[_measure(one) for one in settings if shown(one.values[name]) == value] for value in values]
    known = [[one for one in group if one is not None] for group in measures]
    judged = any(one.recall is not None for one in settings)
    most = 105.0 if judged else 1.05 * max((max(group) for group in known if group), default=1.0) or 1.0
    plot = Plot((-0.5, len(values) - 0.5), (0.0, most), width, 240)
    plot.y_axis("revisits closed, %" if judged else "constraints")
    for k, (value, group) in enumerate(zip(values, known, strict=True)):
        plot.text(plot.x(k), plot.height - 18, value, "middle")
        for measure in group:
            plot.dot(k, measure, "seen", f"{value}: {measure:.0f}", 4.0)
    means = np.array([(k, np.mean(group)) for k, group in enumerate(known) if group])
    if len(means):
        plot.line(means, "corrected", "the mean")
    plot.text(plot.width - 14, plot.height - 4, name, "end")
    return plot.svg(f"{'revisits closed' if judged else 'constraints'} against {name}")


def _measure(one: Setting) -> float | None:
    return float(one.total("constraints")) if one.recall is None else _percent(one)


def _percent(one: Setting) -> float:
    return 100 * (one.recall or 0.0)


def _title(one: Setting) -> str:
    return f"{one.text}: {_percent(one):.0f} % of the revisits, {one.total('false')} of {one.total('judged')} false"
