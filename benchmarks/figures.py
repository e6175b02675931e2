# SPDX-License-Identifier: Apache-2.0
"""Measures the figures of this version, and draws docs/figures.md and README's table from them.

    python benchmarks/figures.py --quick              what has no figures of this code yet, smaller; within 20 minutes
    python benchmarks/figures.py                      the same, whole; three to four hours
    python benchmarks/figures.py --only pairs_rpy     one topic, whole
    python benchmarks/figures.py --draw               draw only
    python benchmarks/figures.py --release 0.4.0      keep the figures as those of a version

Each topic of figure_topics.py is a benchmark in a process of its own. What its rows need is kept as
``results/current/TOPIC.json``; a run that is stopped goes on where it was, as a topic that has figures of the same code
is left out. Figures of the whole size are not replaced by quick ones of the same code. Two topics run at once; those
whose times matter run last and alone. The exit status is 1 where a topic failed.
"""

from __future__ import annotations

import os
import shutil
import signal
import sys
from collections.abc import Callable
from pathlib import Path

import click
import dask
from dask.diagnostics import ProgressBar
from figure_draw import draw
from figure_results import CURRENT, RESULTS, Result, code_of, read_result
from figure_run import STOP, TopicError, measure
from figure_topics import TOPICS
from figure_topics.topic import QUICK, WHOLE, Topic, shared_folder


def wanted(topics: list[Topic], size: str, code: str, again: bool) -> list[Topic]:
    """The topics that have no figures of this code and command yet, in this size or the whole one."""
    return [topic for topic in topics if again or not _has(topic, read_result(topic.name), size, code)]


def _has(topic: Topic, result: Result | None, size: str, code: str) -> bool:
    if result is None or result.code != code or result.size not in (size, WHOLE):
        return False
    return result.command == topic.command(result.size)


def measure_all(topics: list[Topic], workers: int, work: Callable[[Topic], Result]) -> list[str]:
    """Measure the topics, first those that may run beside each other; the names of those that failed."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    beside, alone = ([topic for topic in topics if topic.alone == is_alone] for is_alone in (False, True))
    try:
        is_measured = [*_measure(beside, workers, work), *_measure(alone, 1, work)]
    except BaseException:
        STOP.set()
        raise
    return [topic.name for topic, is_right in zip([*beside, *alone], is_measured, strict=True) if not is_right]


def _measure(topics: list[Topic], workers: int, work: Callable[[Topic], Result]) -> tuple[bool, ...]:
    """Whether each was measured; so many run at once."""
    tasks = []
    for number, topic in enumerate(reversed(topics)):  # Dask begins with the last of the keys
        tasks.append(dask.delayed(_is_measured)(work, topic, dask_key_name=f"{number:03}"))
    with ProgressBar(dt=1.0):
        found: tuple[bool, ...] = dask.compute(*reversed(tasks), scheduler="threads", num_workers=workers)
    return found


def _is_measured(work: Callable[[Topic], Result], topic: Topic) -> bool:
    """Measure a topic, and print what it took or why it failed."""
    try:
        result = work(topic)
    except TopicError as error:
        click.echo(f"{topic.name}: {error}", err=True)
        return False
    click.echo(f"{topic.name}: {result.seconds:.0f} s, {result.processor_seconds:.0f} s of the processor")
    return True


def _names(_context: click.Context, _option: click.Parameter, text: str) -> list[Topic]:
    known = {topic.name: topic for topic in TOPICS}
    asked = text.split(",") if text else list(known)
    if unknown := [name for name in asked if name not in known]:
        raise click.BadParameter(f"expected some of {', '.join(known)}, got {', '.join(unknown)}")
    return [known[name] for name in asked]


def _release(version: str) -> None:
    target = RESULTS / version
    if target.exists():
        raise click.UsageError(f"expected a version that is not kept yet, got {version}: {target} is there")
    shutil.copytree(CURRENT, target)


@click.command(help=(__doc__ or "").split("\n")[0])
@click.option("--quick", is_flag=True, help="Smaller sizes, within 20 minutes in all.")
@click.option("--only", "topics", default="", metavar="TOPIC,TOPIC…", callback=_names, help="These topics.")
@click.option("--again", is_flag=True, help="Measure what has figures of this code, too.")
@click.option("--workers", type=click.IntRange(min=1), default=2, show_default=True, help="Topics at once.")
@click.option("--limit", "limit_factor", default=10.0, show_default=True, help="Times a topic's minutes it may take.")
@click.option("--draw", "draw_only", is_flag=True, help="Draw the pages from what is there.")
@click.option("--release", "version", default="", metavar="VERSION", help="Keep the figures as those of VERSION.")
def main(
    quick: bool, topics: list[Topic], again: bool, workers: int, limit_factor: float, draw_only: bool, version: str
) -> None:
    """Measure and draw."""
    failed: list[str] = []
    if version:
        _release(version)
    elif not draw_only:
        size, code, shared = QUICK if quick else WHOLE, code_of(), shared_folder()
        os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        todo = []
        for topic in wanted(topics, size, code, again):
            if why := topic.lacks(size, shared):
                click.echo(f"{topic.name}: left out, {why}")
            else:
                todo.append(topic)
        failed = measure_all(todo, workers, lambda topic: measure(topic, size, code, limit_factor))
    draw()
    if failed:
        raise click.ClickException(f"no figures of {', '.join(failed)}; see {Path('out/figures')}/*.log")


if __name__ == "__main__":
    sys.exit(main())
