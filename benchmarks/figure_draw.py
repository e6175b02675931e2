# SPDX-License-Identifier: Apache-2.0
"""Draws docs/figures.md, docs/figures-history.md and the marked parts of other documents from the kept figures."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, NamedTuple

import jinja2
from figure_results import CURRENT, RESULTS, Result, read_result, version
from figure_topics import README, TOPICS
from figure_topics.topic import QUICK, REPOSITORY, WHOLE, Row, Topic

NOT_MEASURED = "not measured on this version"
BEGIN, END = "<!-- figures: made by benchmarks/figures.py -->", "<!-- end of figures -->"
INLINE = re.compile(r"<!-- figure: ([\w.]+) -->.*?<!-- /figure -->", re.DOTALL)
BUSY = 1.5  # load for each core; one topic beside another is less
MARKED = ("README.md", "docs/limits.md", "docs/gate.md", "docs/robots.md")


class Line(NamedTuple):
    """A row as it is drawn."""

    claim: str
    measured: str
    command: str
    size: str  # empty where nothing was measured


def draw(repository: Path = REPOSITORY) -> None:
    """Write all that is drawn."""
    for name, text in pages(repository).items():
        (repository / name).write_text(text, encoding="utf-8")


def pages(repository: Path = REPOSITORY) -> dict[str, str]:
    """Each document by its name as it is when it is drawn from what ``results`` keeps."""
    drawn = {name: marked(name, (repository / name).read_text(encoding="utf-8")) for name in MARKED}
    drawn["docs/figures.md"] = _template("figures.md.j2").render(
        topics=list(map(section, TOPICS)), version=version(), place=place, usual=usual_place()
    )
    drawn["docs/figures-history.md"] = _template("figures-history.md.j2").render(**history())
    return drawn


def section(topic: Topic) -> dict[str, Any]:
    """A topic of the page: its rows, and of what they are."""
    result = current(topic)
    lines = [line(topic, row, result) for row in topic.rows]
    has_picture = result is not None and result.size == WHOLE and topic.picture
    picture = topic.picture.removeprefix("docs/") if has_picture else ""
    return {"topic": topic, "result": result, "lines": lines, "picture": picture}


def current(topic: Topic) -> Result | None:
    """What was measured of the topic on the version that setup.py states; None where nothing was."""
    result = read_result(topic.name)
    return result if result is not None and result.version == version() else None


def place(result: Result) -> str:
    """When and where something was measured."""
    return f"{result.date}, {result.cores} cores, {result.machine}"


def usual_place() -> str:
    """When and where most of the current topics were measured; the newest of them where there are several."""
    places = [place(result) for result in map(current, TOPICS) if result is not None]
    return max(sorted(places, reverse=True), key=places.count) if places else "no machine yet"


def line(topic: Topic, row: Row, result: Result | None) -> Line:
    """A row with what was measured, and the command that did it or would."""
    text = _measured(row, result)
    command = result.command if result else topic.command(QUICK)
    if text is None or result is None:
        return Line(row.claim, NOT_MEASURED, command, "")
    is_busy = row.timed and result.load > BUSY * result.cores
    return Line(row.claim, f"{text} (busy machine)" if is_busy else text, command, result.size)


def _measured(row: Row, result: Result | None) -> str | None:
    """The text of a row; None where it was not measured, or had other values then."""
    try:
        return row.measured(result.figures[row.key]) if result else None
    except KeyError:
        return None


def marked(name: str, text: str) -> str:
    """A document with its marked parts drawn: the table of README, and figures within sentences."""
    if name == "README.md":
        before, after = text.split(BEGIN)[0], text.split(END)[1]
        table = _template("readme.md.j2").render(lines=readme_lines())
        text = f"{before}{BEGIN}\n\n{table}\n{END}{after}"
    return INLINE.sub(lambda found: f"<!-- figure: {found[1]} -->{figure(found[1])}<!-- /figure -->", text)


def readme_lines() -> list[Line]:
    """The rows that README shows."""
    return [line(*_found(name))._replace(claim=claim) for name, claim in README.items()]


def figure(name: str) -> str:
    """The measured text of a row ``topic.key``; of ``topic.key.value`` the one value alone."""
    topic, row, result = _found(".".join(name.split(".")[:2]))
    value = name.split(".")[2:]
    if value and result is not None and row.key in result.figures:
        return str(result.figures[row.key][value[0]])
    return line(topic, row, result).measured


def _found(name: str) -> tuple[Topic, Row, Result | None]:
    topic_name, _, key = name.partition(".")
    for topic in TOPICS:
        for row in topic.rows:
            if (topic.name, row.key) == (topic_name, key):
                return topic, row, current(topic)
    raise ValueError(f"expected a row of benchmarks/figure_topics, got {name}")


def history() -> dict[str, Any]:
    """Every row over the versions that are kept, the current one last."""
    folders = sorted(
        (f for f in RESULTS.glob("*.*.*") if f.is_dir()), key=lambda f: [int(n) for n in f.name.split(".")]
    )
    columns = [*folders, CURRENT]
    rows = [(topic, row, [_kept(topic, row, folder) for folder in columns]) for topic in TOPICS for row in topic.rows]
    return {"versions": [folder.name for folder in columns], "rows": rows}


def _kept(topic: Topic, row: Row, folder: Path) -> str:
    result = read_result(topic.name, folder)
    text = _measured(row, result)
    return "–" if text is None or result is None else f"{text} ({result.size})"


def _template(name: str) -> jinja2.Template:
    loader = jinja2.FileSystemLoader(REPOSITORY / "benchmarks/templates")
    environment = jinja2.Environment(
        loader=loader,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    return environment.get_template(name)
