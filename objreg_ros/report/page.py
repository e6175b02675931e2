# SPDX-License-Identifier: Apache-2.0
"""The report: one self-contained HTML page that opens offline, in light and in dark."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from objreg_ros.report.bundle import plotly_bundle
from objreg_ros.report.run.comparison import comparison
from objreg_ros.report.run.pictures import Album
from objreg_ros.report.run.run_summary import RunSummary
from objreg_ros.report.run.sections import chapter

TEMPLATES = Path(__file__).parent / "templates"


def page(chapters: Sequence[tuple[RunSummary, Album | None]]) -> str:
    """The HTML of a report, a chapter for each run; one without an album has no pictures.

    More runs than one are compared before them.
    """
    bundle = plotly_bundle()
    views = [chapter(story, album, len(chapters), spatial=bool(bundle)) for story, album in chapters]
    compared = comparison([story for story, _ in chapters]) if len(chapters) > 1 else None
    for view, name in zip(views, compared["names"] if compared else (), strict=False):
        view["letter"] = name
    template = environment().get_template("page.html.j2")
    title = ", ".join(view["name"] for view in views)
    return template.render(title=title, chapters=views, compared=compared, bundle=bundle)


@cache
def environment() -> Environment:
    """The templates; they escape their values, and a name that is not given is an error."""
    loader = FileSystemLoader(TEMPLATES)
    made = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    made.globals["source"] = lambda name: loader.get_source(made, name)[0]
    made.policies["json.dumps_kwargs"] = {"ensure_ascii": False, "separators": (",", ":")}
    return made
