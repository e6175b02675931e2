# SPDX-License-Identifier: Apache-2.0
"""The field's words: what the code and the documents say no more."""

from __future__ import annotations

import re
from pathlib import Path

# The word, and where it has its common meaning: doors, rooms and books of simulated buildings, opencv's own names.
OLD = {
    r"hears?|heard|hearing": "receive",
    r"ledger|receipts?": "accounting, acknowledgement",
    r"Indoors|Inlet|Outlet|\w+Door|DoorParams": "IntraProcessBus, ValueQueue, LocalPublisher, NodeBase",
    r"tell(?:s|ing|_\w+)?|_?told(?:_\w+)?|\w+_told|_tell\w*": "report, state, given, known",
    r"[Ss]tory|[Ss]tories|write_story|make_story|chapters?": "RunSummary, run; RecordingPlan, plan",
    r"Thing|Pace|Course|Shelf|odometry_words|camera_words_of|closure_words": "UnnamedPixels, FrameOrder",
    r"chains_disagree|few_objects_explained": "proposers_disagree, few_objects_matched",
}
KEPT = re.compile(r'file\.tell\(\)|"told(\.npy)?"')  # Python's name of a place in a file; a member of saved maps
FOLDERS = ("objreg_ros", "objreg_mapper", "objreg_tools", "docs", "launch", "config", "benchmarks", "training", "test")
LEFT_OUT = ("docs/releases", "objreg_tools/simulation", "test/test_words.py")


def lines_with(repository: Path, pattern: str) -> list[str]:
    """Where a word is said in code, templates and documents."""
    said = re.compile(rf"\b(?:{pattern})\b")
    found = []
    for folder in FOLDERS:
        for path in sorted((repository / folder).rglob("*")):
            name = path.relative_to(repository).as_posix()
            if path.suffix not in (".py", ".md", ".j2", ".yaml") or name.startswith(LEFT_OUT):
                continue
            lines = path.read_text(encoding="utf-8").splitlines()
            lines = [KEPT.sub("", line) for line in lines]
            found += [f"{name}:{k}: {line.strip()}" for k, line in enumerate(lines, 1) if said.search(line)]
    return found


def test_an_old_word_is_said_no_more(repository: Path) -> None:
    for pattern in OLD:
        assert not lines_with(repository, pattern), f"say: {OLD[pattern]}"


def test_a_word_that_is_said_is_found(repository: Path) -> None:
    assert lines_with(repository, "NodeBase")
