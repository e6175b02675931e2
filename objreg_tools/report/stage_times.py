# SPDX-License-Identifier: Apache-2.0
"""How long the stages of a node took, each beside the total that it is part of."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TypeVar

Times = TypeVar("Times")

TOTAL, KEYFRAME = "total", "keyframe"
OF_KEYFRAMES = ("wait", "search", "keep", "pack", KEYFRAME)  # where a node times them apart from its frames


def in_order(stages: Mapping[str, Times]) -> Iterator[tuple[str, str, Times]]:
    """The stages of frames with their total behind them, then those of keyframes: (part, stage, times).

    ``part`` is empty for those of frames, and ", keyframe" for the others, whose total is called that too.
    """
    apart = OF_KEYFRAMES if KEYFRAME in stages else ()
    for name in sorted((name for name in stages if name not in apart), key=lambda name: name == TOTAL):
        yield "", name, stages[name]
    for name in (name for name in apart if name in stages):
        yield f", {KEYFRAME}", TOTAL if name == KEYFRAME else name, stages[name]
