# SPDX-License-Identifier: Apache-2.0
"""A look at the first frames of a recording before a run, with a bar: what of the stream is not as it says."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from tqdm import tqdm

from objreg_ros.plausibility.finding import Finding
from objreg_tools.offline.run import Run
from objreg_tools.rehearsal import FRAMES
from objreg_tools.report.run.findings import found_in


@dataclass(frozen=True, slots=True)
class FirstLook:
    """The ``run`` of the first frames, empty where a broken file ended it, and what was found in them.

    ``runs`` is whether the graph would run on them.
    """

    run: Run
    runs: bool
    findings: tuple[Finding, ...]


def look(rehearse: Callable[[Callable[[int], None]], Run], frames: int = FRAMES) -> FirstLook:
    """Call ``rehearse``, which reports how many of at most so many ``frames`` are through."""
    through = 0
    with tqdm(total=frames, unit="frame", desc="looking at frames", disable=None, leave=False) as bar:

        def show(count: int) -> None:
            nonlocal through
            bar.update(count - through)
            through = count  # a bar that is not shown counts nothing

        try:
            run = rehearse(show)
        except ValueError as error:  # a file that is broken in its middle: a run has what comes before
            return FirstLook(Run(), through > 0, (Finding(str(error)),))
    return FirstLook(run, run.frames > 0, found_in(run))
