# SPDX-License-Identifier: Apache-2.0
"""The names of a model's classes: from a file, or from the model's metadata."""

from __future__ import annotations

import ast
import json
from collections.abc import Mapping
from pathlib import Path

NO_CLASS = "???"
"""What a label file writes for the background and for a class without a name."""

FILE_BYTES = 1 << 24
"""The longest file of labels that is read."""

METADATA_KEY = "objreg.labels"
ULTRALYTICS_KEY = "names"

NAMES_TEXT = 200_000
"""The longest text of Ultralytics' names that is read, in characters: a tree of it takes a hundred times as much."""


def find_labels(model_path: Path, labels_path: Path | None, metadata: Mapping[str, str]) -> tuple[str, ...]:
    """The labels of a model: of a file, else of the metadata, else of a file beside the model.

    The file is ``labels_path``; the metadata this project's or Ultralytics'; beside it ``<model>.txt`` or labelmap.txt.
    Label c is that of the c-th class, counted from 0 and without background. ValueError when there are none.
    """
    if labels_path is not None:
        return read_labels(labels_path)
    if METADATA_KEY in metadata:
        return _labels_of_metadata(metadata[METADATA_KEY])
    if ULTRALYTICS_KEY in metadata:
        return _labels_of_names(metadata[ULTRALYTICS_KEY])
    beside = (model_path.with_suffix(".txt"), model_path.with_name("labelmap.txt"))
    for path in beside:
        if path.is_file():
            return read_labels(path)
    raise ValueError(
        f"labels of {model_path.name}: expected {METADATA_KEY} or {ULTRALYTICS_KEY} in its metadata or one of "
        f"{', '.join(str(path) for path in beside)}, got neither; name a file of one label a line with `labels`"
    )


def read_labels(path: Path) -> tuple[str, ...]:
    """The labels of a text file, one a line. A first line ``???`` stands for the background and is left out."""
    if path.exists() and (not path.is_file() or path.stat().st_size > FILE_BYTES):
        got = f"{path.stat().st_size} bytes" if path.is_file() else "a folder, pipe or device"
        raise ValueError(f"labels {path}: expected a file of one label a line, at most {FILE_BYTES} bytes, got {got}")
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"labels {path}: expected a text file of one label a line, got {error}") from error
    names = [line.strip() for line in lines]
    while names and not names[-1]:
        names.pop()
    labels = tuple(names[1:] if names and names[0] == NO_CLASS else names)
    if not labels or "" in labels:
        raise ValueError(f"labels {path}: expected one label a line, got {len(labels)} with an empty one or none")
    return labels


def _labels_of_metadata(text: str) -> tuple[str, ...]:
    try:
        labels = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{METADATA_KEY}: expected a JSON list of names, got {text[:80]!r}") from error
    if not isinstance(labels, list) or not labels or not all(isinstance(name, str) and name for name in labels):
        raise ValueError(f"{METADATA_KEY}: expected a JSON list of names, got {text[:80]!r}")
    return tuple(labels)


def _labels_of_names(text: str) -> tuple[str, ...]:
    """The labels of Ultralytics' ``names``, a Python dict of class numbers from 0 and names, or a list, as text."""
    expected = f"{ULTRALYTICS_KEY} in the metadata: expected a dict of class numbers from 0 and names"
    try:
        if len(text) > NAMES_TEXT:
            raise ValueError(f"a text of {len(text)} characters, of at most {NAMES_TEXT}")
        names = ast.literal_eval(text)
        labels = [names[number] for number in range(len(names))] if isinstance(names, dict | list) else []
    except (ValueError, SyntaxError, TypeError, KeyError, RecursionError, MemoryError) as error:
        raise ValueError(f"{expected}, got {text[:80]!r}") from error
    if not labels or not all(isinstance(name, str) and name.strip() for name in labels):
        raise ValueError(f"{expected}, got {text[:80]!r}; name a file of one label a line with `labels`")
    return tuple(name.strip() for name in labels)
