# SPDX-License-Identifier: Apache-2.0
"""What a topic of docs/figures.md is: a command in two sizes, and the rows that its JSON becomes."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from string import Formatter
from typing import Any

REPOSITORY = Path(__file__).resolve().parents[2]
QUICK, WHOLE = "quick", "whole"
SHARED_PATHS = {
    "KITCHEN": "data/redkitchen_a",
    "RPY": "data/tum_fr1_rpy",
    "COCO": "models/ssd_mobilenet_v1_coco_int8.onnx",
}  # below $OBJREG_SHARED; they are not part of the project
Values = dict[str, float | str]


def nothing() -> None:
    """What a machine lacks where it lacks nothing."""


@dataclass(frozen=True)
class Row:
    """One claim: its ``values``, taken from the JSON of the command, and the ``text`` that has them in braces.

    Of a ``timed`` one the page says where the machine was busy.
    """

    key: str
    claim: str
    text: str
    values: Callable[[Any], Values]
    timed: bool = False

    def taken(self, raw: Any) -> Values:
        """The values that the text has, of the command's JSON."""
        found = self.values(raw)
        return {name: found[name] for _, name, _, _ in Formatter().parse(self.text) if name}

    def measured(self, values: Values) -> str:
        """The measured text."""
        return self.text.format(**values)


@dataclass(frozen=True)
class Topic:
    """A benchmark, with the arguments of both sizes, in which a key of `SHARED_PATHS` stands for its path.

    ``KEEP`` stands for a folder in which the command may keep what it has. ``lack`` says what else this machine lacks.
    One that is measured ``alone`` runs beside no other topic, for its times. ``minutes`` are those of the sizes on two
    cores without other work. A command that ``judges`` ends with status 1 where it found something wrong, which is a
    figure, too. The whole size draws a ``picture``, where one is named.
    """

    name: str
    title: str
    script: str
    quick: str
    whole: str
    minutes: tuple[float, float]
    rows: tuple[Row, ...]
    about: str = ""
    alone: bool = False
    judges: bool = False
    lack: Callable[[], str | None] = nothing
    picture: str = ""

    def command(self, size: str) -> str:
        """The command line of a size as the page has it: without its ``--json`` and what it keeps."""
        line = f"{self.script} {self.quick if size == QUICK else self.whole}"
        return line.replace(" --keep KEEP", "").strip()

    def argv(self, size: str, out: Path, keep: Path, shared: Path) -> list[str]:
        """The arguments as they are run."""
        paths = {name: str(shared / path) for name, path in SHARED_PATHS.items()} | {"KEEP": str(keep)}
        script, *given = shlex.split(f"{self.script} {self.quick if size == QUICK else self.whole}")
        return [str(REPOSITORY / script), *(paths.get(argument, argument) for argument in given), "--json", str(out)]

    def lacks(self, size: str, shared: Path) -> str:
        """Why the topic cannot be measured here; empty where it can."""
        needed = [name for name in SHARED_PATHS if name in shlex.split(self.command(size))]
        missing = [name for name in needed if not (shared / SHARED_PATHS[name]).exists()]
        return f"needs {', '.join(missing)} in $OBJREG_SHARED" if missing else self.lack() or ""


def shared_folder() -> Path:
    """The folder with recordings that are not part of the project; it need not exist."""
    return Path(os.environ.get("OBJREG_SHARED", REPOSITORY.parent / "shared")).resolve()
