# SPDX-License-Identifier: Apache-2.0
"""Commands that go on from a run, or withdraw a closure of it, as they may be pasted."""

from __future__ import annotations

import shlex
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

from objreg_ros.data.closure_id import closure_id
from objreg_ros.data.closures import LoopClosure, Rejected

PASSED_ON = ("--model", "--labels", "--camera", "--params", "--set", "--remap", "--detections")
OF_RUN = (*PASSED_ON, "--odometry", "--max-frames")  # of what runs a whole recording


def pair_command(summary: Mapping[str, Any], first_s: float, second_s: float) -> str:
    """`objreg pair` for two times of a run, s since its first frame, with the options that the run was made with.

    Empty where its JSON names no recording.
    """
    recording = summary.get("recording")
    if not recording:
        return ""
    try:
        words = shlex.split((summary.get("about") or {}).get("command") or "")
    except ValueError:  # no command of ours
        words = []
    times = f"{first_s:.3f}", f"{second_s:.3f}"
    return shlex.join(["objreg", "pair", recording, *times, "--keyframes", *passed_on(words)])


def veto_command(summary: Mapping[str, Any], outcome: LoopClosure | Rejected) -> str:
    """`objreg veto` for a closure of a run, in its store, or in one that is still to be named.

    Empty for a refusal: there is nothing to withdraw.
    """
    if not isinstance(outcome, LoopClosure):
        return ""
    return shlex.join(["objreg", "veto", summary.get("store") or "STORE", closure_id(outcome)])


def passed_on(words: Sequence[str], names: Collection[str] = PASSED_ON) -> Iterator[str]:
    """Those words of a command line that are options of these ``names``, with their values."""
    for k, word in enumerate(words):
        name, sign, _ = word.partition("=")
        if name in names and sign:
            yield word
        elif name in names:
            yield from words[k : k + 2]
