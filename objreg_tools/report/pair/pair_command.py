# SPDX-License-Identifier: Apache-2.0
"""The commands that register a pair of a run once more, and that withdraw its closure, as they may be pasted."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from objreg_ros.data.closure_id import closure_id
from objreg_ros.data.closures import LoopClosure, Rejected

PASSED_ON = ("--model", "--labels", "--camera", "--params", "--set", "--remap", "--detections")


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
    return shlex.join(["objreg", "pair", recording, *times, "--keyframes", *_passed_on(words)])


def veto_command(summary: Mapping[str, Any], outcome: LoopClosure | Rejected) -> str:
    """`objreg veto` for a closure of a run, in its store, or in one that is still to be named.

    Empty for a refusal: there is nothing to withdraw.
    """
    if not isinstance(outcome, LoopClosure):
        return ""
    return shlex.join(["objreg", "veto", summary.get("store") or "STORE", closure_id(outcome)])


def _passed_on(words: Sequence[str]) -> Iterator[str]:
    """The options that `objreg pair` has too, with their values."""
    for k, word in enumerate(words):
        name, sign, _ = word.partition("=")
        if name in PASSED_ON and sign:
            yield word
        elif name in PASSED_ON:
            yield from words[k : k + 2]
