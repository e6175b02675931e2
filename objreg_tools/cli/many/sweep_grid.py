# SPDX-License-Identifier: Apache-2.0
"""The combinations of a sweep: what `--set node.name=a,b,c` and a name that is set more than once mean."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from itertools import product
from typing import Any

from objreg_tools.cli.settings import NODES, parse_change

MOST = 256  # combinations: each is a run of every recording
WHOLE = ("segmenter.camera",)  # a text whose commas are its own
DIGITS = 8


@dataclass(frozen=True, slots=True)
class Combination:
    """One value of each parameter that is swept, as texts, by ``node.name``."""

    values: Mapping[str, str]

    @property
    def changes(self) -> tuple[str, ...]:
        """As `--set` takes them."""
        return tuple(f"{name}={text}" for name, text in self.values.items())

    @property
    def parsed(self) -> dict[str, Any]:
        """The values in their declared types."""
        return {name: parse_change(f"{name}={text}")[2] for name, text in self.values.items()}

    @property
    def digest(self) -> str:
        """The same for the same values, in whatever order and spelling they were given."""
        values = sorted((name, repr(value)) for name, value in self.parsed.items())
        return sha256(repr(values).encode(errors="surrogateescape")).hexdigest()[:DIGITS]


@dataclass(frozen=True, slots=True)
class Grid:
    """The values of each parameter that is ``swept``, as texts, and the changes that are ``fixed`` in all runs."""

    swept: Mapping[str, tuple[str, ...]]
    fixed: tuple[str, ...]

    @classmethod
    def of(cls, changes: Sequence[str]) -> Grid:
        """The grid of the values of `--set`.

        Commas part values, but not in a list, whose own they are, nor in `WHOLE`. A name that is given more than once
        is swept too. ValueError for a value that is refused, where nothing is swept, and for more than `MOST`.
        """
        values: dict[str, dict[Any, str]] = {}
        for change in changes:
            name, sign, text = change.partition("=")
            for one in _parted(name, text) if sign else (text,):
                parsed = parse_change(f"{name}{sign}{one}")[2]
                values.setdefault(name, {}).setdefault(repr(parsed), one)
        swept = {name: tuple(texts.values()) for name, texts in values.items() if len(texts) > 1}
        fixed = tuple(f"{name}={next(iter(texts.values()))}" for name, texts in values.items() if len(texts) == 1)
        if not swept:
            raise ValueError("--set: expected several values of a parameter, as registrar.least_odds=20,75,300")
        grid = cls(swept, fixed)
        if len(grid) > MOST:
            raise ValueError(f"--set: expected at most {MOST} combinations, got {grid.text}; leave values out")
        return grid

    def __len__(self) -> int:
        return math.prod(len(texts) for texts in self.swept.values())

    @property
    def text(self) -> str:
        """How many combinations there are, and of how many values each."""
        factors = " × ".join(str(len(texts)) for texts in self.swept.values())
        return f"{len(self)}" if len(self.swept) == 1 else f"{len(self)} ({factors})"

    @property
    def combinations(self) -> list[Combination]:
        """Every one, the last parameter changing first."""
        return [Combination(dict(zip(self.swept, texts, strict=True))) for texts in product(*self.swept.values())]


def _parted(path: str, text: str) -> list[str]:
    """The values in a text."""
    node, _, name = path.partition(".")
    known = (declaration for kind in NODES.get(node, ()) for declaration in kind.declarations())
    declaration = next((one for one in known if one.name == name), None)
    if declaration is None or declaration.many or path in WHOLE:
        return [text]
    return [part.strip() for part in text.split(",")]


def default_of(path: str) -> Any:
    """The default of ``node.name``; ValueError where no node has it."""
    node, _, name = path.partition(".")
    for kind in NODES.get(node, ()):
        for declaration in kind.declarations():
            if declaration.name == name:
                return declaration.default
    raise ValueError(f"{path}: expected a parameter of a node, got none of this name")
