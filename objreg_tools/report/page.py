# SPDX-License-Identifier: Apache-2.0
"""The report: one self-contained HTML page that opens offline, in light and in dark."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from objreg_tools.report.bundle import plotly_bundle
from objreg_tools.report.run.comparison import comparison
from objreg_tools.report.run.pictures import Album
from objreg_tools.report.run.run_summary import RunSummary
from objreg_tools.report.run.sections import view_of_run

TEMPLATES = Path(__file__).parent / "templates"


def page(loaded: Sequence[tuple[RunSummary, Album | None]], compared_last: bool = False) -> str:
    """The HTML of a report, one section a run; one without an album has no pictures.

    More runs than one are compared before them; with ``compared_last`` after them.
    """
    bundle = plotly_bundle()
    views = [view_of_run(run, album, len(loaded), spatial=bool(bundle)) for run, album in loaded]
    compared = comparison([run for run, _ in loaded]) if len(loaded) > 1 else None
    for view, name in zip(views, compared["names"] if compared else (), strict=False):
        view["letter"] = name
    template = environment().get_template("page.html.j2")
    title = ", ".join(view["name"] for view in views)
    return template.render(title=title, runs=views, compared=compared, compared_last=compared_last, bundle=bundle)


@cache
def environment() -> Environment:
    """The templates; they escape their values, and a name that is not given is an error."""
    loader = FileSystemLoader(TEMPLATES)
    made = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    made.globals["source"] = lambda name: loader.get_source(made, name)[0]
    made.policies["json.dumps_kwargs"] = {"ensure_ascii": False, "separators": (",", ":")}
    return made
