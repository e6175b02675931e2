# SPDX-License-Identifier: Apache-2.0
"""What a node reports is declared once, as a field of its frozen dataclass:

    @dataclass(frozen=True, kw_only=True)
    class KeyframerDiagnostics(Diagnostics):
        sent: int = reading("keyframes sent", "Keyframes that were published.", "keyframes")

From that line come the key and the value on /diagnostics, and docs/diagnostics.md. This file knows neither ROS nor any
node.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator, Mapping
from typing import Any

PLACE = re.compile(r"<\w+>")  # of a name in the key of a family


@dataclasses.dataclass(frozen=True, slots=True)
class Declaration:
    """What is known of one field. ``key`` is the published text; that of a family has a `<name>` for each name in it.

    ``form`` is a format for the value, as of `str.format`; empty for a value that is published as it is.
    """

    name: str
    key: str
    doc: str
    unit: str = ""
    form: str = ""

    def shown(self, value: object) -> object:
        """A value as it is published."""
        return self.form.format(value) if self.form else value


def reading(key: str, doc: str, unit: str = "", form: str = "", default: Any = dataclasses.MISSING) -> Any:
    """Declare one key. A value of None is not published."""
    return dataclasses.field(default=default, metadata={"key": key, "doc": doc, "unit": unit, "form": form})


def family(key: str, doc: str, unit: str = "", form: str = "") -> Any:
    """Declare keys that differ by a name, or by several: a mapping from it, or from a tuple of them, to the value.

    An empty name leaves out the colon behind it too: `<robot>: odometry` is then `odometry`.
    """
    metadata = {"key": key, "doc": doc, "unit": unit, "form": form}
    return dataclasses.field(default_factory=dict, metadata=metadata)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Diagnostics:
    """The base of what nodes report."""

    @classmethod
    def declarations(cls) -> tuple[Declaration, ...]:
        """Every field of this class, in order."""
        return tuple(Declaration(name=field.name, **field.metadata) for field in dataclasses.fields(cls))


def by_key(*parts: Diagnostics) -> dict[str, object]:
    """The values by the keys under which they are published; those with a format as text."""
    return {key: value for part in parts for key, value in _published(part)}


def _published(part: Diagnostics) -> Iterator[tuple[str, object]]:
    for declaration in part.declarations():
        value = getattr(part, declaration.name)
        if isinstance(value, Mapping):
            for names, one in sorted(value.items()):
                yield _member(declaration.key, names), declaration.shown(one)
        elif value is not None:
            yield declaration.key, declaration.shown(value)


def _member(key: str, names: str | tuple[str, ...]) -> str:
    """The key of one of a family; ValueError for another number of names."""
    before, *behind = PLACE.split(key)
    named = zip((names,) if isinstance(names, str) else names, behind, strict=True)
    return before + "".join(f"{name}{rest}" if name else rest.removeprefix(": ") for name, rest in named)
