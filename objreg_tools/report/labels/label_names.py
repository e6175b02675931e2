# SPDX-License-Identifier: Apache-2.0
"""The names that a user gives to landmarks, on the command line or in a file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import yaml

from objreg_ros import limits
from objreg_ros.data.frames import UNNAMED
from objreg_tools.report.labels.mapped_objects import MappedObject

EXAMPLE = "12=mug"


def read_names(file: Path | None, pairs: Iterable[str] = ()) -> dict[int, str]:
    """Names by landmark: those of a YAML file, ``12: mug`` a line, then ``12=mug`` of the command line, which hold.

    An empty name leaves a landmark out. ValueError for what is no such text, OSError for a file that is not there.
    """
    names = {} if file is None else _of_file(file)
    for text in pairs:
        number, sign, name = text.partition("=")
        if not sign:
            raise ValueError(f"--name: expected a landmark and its name as {EXAMPLE}, got {text!r}")
        names[_number("--name", number)] = _name("--name", name)
    return names


def class_of(thing: MappedObject, names: Mapping[int, str], named_only: bool = False) -> str:
    """The class of an object: the name that it was given by any of its ids, else its label; empty to leave it out."""
    given = [names[number] for number in thing.ids if number in names]
    if given:
        return given[0]
    return "" if named_only and thing.label == UNNAMED else thing.label


def unknown(names: Mapping[int, str], objects: Iterable[MappedObject]) -> list[int]:
    """The landmarks that have a name and that the run has not got."""
    known = {number for one in objects for number in one.ids}
    return sorted(names.keys() - known)


def names_text(objects: Iterable[MappedObject], names: Mapping[int, str]) -> str:
    """A file of names as `read_names` reads it, of all objects as they are now."""
    head = "# landmark: name. Change names, and give the file as --names; an empty one ('') leaves its landmark out.\n"
    return head + yaml.safe_dump(
        {one.landmark: class_of(one, names) for one in objects}, allow_unicode=True, sort_keys=True
    )


def _of_file(file: Path) -> dict[int, str]:
    try:
        content = yaml.safe_load(file.read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ValueError(f"{file}: expected a landmark and its name a line, as 12: mug, got {error}") from error
    if content is None:
        return {}
    if not isinstance(content, dict):
        raise ValueError(f"{file}: expected a landmark and its name a line, as 12: mug, got {type(content).__name__}")
    return {_number(str(file), number): _name(str(file), name) for number, name in content.items()}


def _number(where: str, number: object) -> int:
    text = str(number).strip()
    if isinstance(number, bool) or not (text.isascii() and text.isdecimal()):
        raise ValueError(f"{where}: expected the number of a landmark, as in {EXAMPLE}, got {number!r}")
    return int(text)


def _name(where: str, name: object) -> str:
    text = "" if name is None else str(name).strip()
    if not text.isprintable() or len(text) > limits.MOST_NAME:
        raise ValueError(f"{where}: expected a name of at most {limits.MOST_NAME} letters in one line, got {text!r}")
    return text
