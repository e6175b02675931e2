# SPDX-License-Identifier: Apache-2.0
"""The names of a model's classes: from a file, or from the model's metadata."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import yaml

NO_CLASS = "???"
"""What a label file writes for the background and for a class without a name."""

FILE_BYTES = 1 << 24
"""The longest file of labels that is read."""

ENDS = (".txt", ".names", ".yaml", ".yml")
"""How the file of labels beside a model may end, behind the model's own name."""

LABEL_MAP = "labelmap.txt"
REMEDY = "name a file of one label a line with `labels` (of a command: --labels)"
IS_YAML = re.compile(r"\A\s*[\[{]|^names\s*:|\A(#.*\n|\s)*(- |0\s*:\s)", re.MULTILINE)
"""What YAML begins with or has: ``names:``, a list, or class numbers."""

METADATA_KEY = "objreg.labels"
ULTRALYTICS_KEY = "names"

NAMES_TEXT = 200_000
"""The longest text of Ultralytics' names that is read, in characters: a tree of it takes a hundred times as much."""


Labels = tuple[str, ...]


def find_labels(
    model_path: Path,
    labels_path: Path | None,
    metadata: Mapping[str, str],
    require: Callable[[Labels], object] = lambda labels: None,
) -> Labels:
    """The labels of a model: of a file, else of the metadata, else of a file beside the model.

    The file is ``labels_path``; the metadata this project's or Ultralytics'; beside it ``<model>`` with an end of
    `ENDS`, or labelmap.txt. Label c is that of the c-th class, counted from 0 and without background. ``require``
    raises ValueError for labels that the model cannot have: then the next place is looked at. ValueError when none is
    left: that of the first place.
    """
    if labels_path is not None:
        return read_labels(labels_path)
    own = model_path.with_suffix(ENDS[0])
    refusals = []
    for read in _places(model_path, metadata):
        try:
            labels = read()
        except ValueError as error:
            refusals.append(ValueError(f"{error}; {REMEDY}, or put that file beside the model as {own.name}"))
            continue
        try:
            require(labels)
            return labels
        except ValueError as error:
            refusals.append(error)
    if refusals:
        raise refusals[0]
    raise ValueError(
        f"labels of {model_path.name}: expected {METADATA_KEY} or {ULTRALYTICS_KEY} in its metadata or one of "
        f"{own}, {model_path.with_name(LABEL_MAP)}, got neither; {REMEDY}"
    )


def _places(model_path: Path, metadata: Mapping[str, str]) -> Iterator[Callable[[], Labels]]:
    """What reads the labels at each place that there is, the best first."""
    if METADATA_KEY in metadata:
        yield partial(_labels_of_metadata, metadata[METADATA_KEY])
    if ULTRALYTICS_KEY in metadata:
        yield partial(_labels_of_names, metadata[ULTRALYTICS_KEY])
    beside = (*(model_path.with_suffix(end) for end in ENDS), model_path.with_name(LABEL_MAP))
    yield from (partial(read_labels, path) for path in beside if path.is_file())


def read_labels(path: Path) -> Labels:
    """The labels of a text file, one a line, or of YAML: a list, numbers and names, or either below ``names``.

    A first line ``???`` stands for the background and is left out. ValueError for what is no such file.
    """
    if path.exists() and (not path.is_file() or path.stat().st_size > FILE_BYTES):
        got = f"{path.stat().st_size} bytes" if path.is_file() else "a folder, pipe or device"
        raise ValueError(f"labels {path}: expected a file of one label a line, at most {FILE_BYTES} bytes, got {got}")
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"labels {path}: expected a text file of one label a line, got {error}") from error
    names = _names_of_yaml(path, text) if IS_YAML.search(text) else [line.strip() for line in text.splitlines()]
    while names and not names[-1]:
        names.pop()
    labels = tuple(names[1:] if names and names[0] == NO_CLASS else names)
    if not labels or "" in labels:
        raise ValueError(
            f"labels {path}: expected one label a line, or names: of YAML, got {len(labels)} with an empty one or none"
            "; write the names of the model's classes in their order"
        )
    return labels


def _names_of_yaml(path: Path, text: str) -> list[str]:
    """The names in YAML, as Ultralytics' files of a data set have them; ValueError where there are none."""
    expected = f"labels {path}: expected one label a line, or names: with class numbers from 0 and names"
    if len(text) > NAMES_TEXT:
        raise ValueError(f"{expected}, of at most {NAMES_TEXT} characters, got {len(text)}")
    try:
        values = yaml.load(text, yaml.BaseLoader)  # nothing but text, lists and mappings
        names = in_order(values.get("names", values) if isinstance(values, dict) else values)
    except (yaml.YAMLError, ValueError, LookupError, TypeError, RecursionError) as error:
        raise ValueError(f"{expected}, got: {' '.join(str(error).split())[:200]}") from error
    return [name.strip() for name in names]


def in_order(names: Any) -> list[str]:
    """The names of a list, or of a dict of class numbers from 0, in their order; ValueError for anything else."""
    if isinstance(names, dict):
        numbered = {int(number): name for number, name in names.items()}
        if sorted(numbered) != list(range(len(names))):
            raise ValueError(f"class numbers {', '.join(map(str, list(names)[:5]))}, which do not count from 0")
        names = [numbered[number] for number in range(len(numbered))]
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise ValueError("no list of names")
    return names


def _labels_of_metadata(text: str) -> Labels:
    try:
        labels = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{METADATA_KEY}: expected a JSON list of names, got {text[:80]!r}") from error
    if not isinstance(labels, list) or not labels or not all(isinstance(name, str) and name for name in labels):
        raise ValueError(f"{METADATA_KEY}: expected a JSON list of names, got {text[:80]!r}")
    return tuple(labels)


def _labels_of_names(text: str) -> Labels:
    """The labels of Ultralytics' ``names``, a Python dict of class numbers from 0 and names, or a list, as text."""
    expected = f"{ULTRALYTICS_KEY} in the metadata: expected a dict of class numbers from 0 and names"
    try:
        if len(text) > NAMES_TEXT:
            raise ValueError(f"a text of {len(text)} characters, of at most {NAMES_TEXT}")
        labels = in_order(ast.literal_eval(text))
    except (ValueError, SyntaxError, TypeError, KeyError, RecursionError, MemoryError) as error:
        raise ValueError(f"{expected}, got {text[:80]!r}") from error
    if not labels or not all(name.strip() for name in labels):
        raise ValueError(f"{expected}, got {text[:80]!r}")
    return tuple(name.strip() for name in labels)
