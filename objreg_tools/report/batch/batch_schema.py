# SPDX-License-Identifier: Apache-2.0
"""What of the JSON of a recording the tables and the page of a batch take, and of what type that is.

The file may have been edited, or be of another program.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from reprlib import repr as short
from types import MappingProxyType
from typing import Any

Kind = Callable[[Any, str], None]
"""ValueError where a value, of this name, is not of the kind."""

MOST = 1 << 53  # of a count: sums of them stay exact
WHOLE = 1 << 63  # nanoseconds


def require_result(summary: Any) -> None:
    """ValueError with expected and got where ``summary`` is not what `objreg batch` wrote of a recording."""
    RESULT(summary, "result")


def _expect(holds: bool, name: str, what: str, got: Any) -> None:
    if not holds:
        raise ValueError(f"{name}: expected {what}, got {short(got)}")


def _whole(least: int, below: int) -> Kind:
    def check(value: Any, name: str) -> None:
        fits = isinstance(value, int) and not isinstance(value, bool) and least <= value < below
        _expect(fits, name, f"a whole number of {least} to {below - 1}", value)

    return check


def _number(value: Any, name: str) -> None:
    is_whole = isinstance(value, int) and not isinstance(value, bool) and abs(value) < WHOLE
    _expect(is_whole or isinstance(value, float), name, "a number", value)


def _duration(value: Any, name: str) -> None:
    _number(value, name)
    _expect(math.isfinite(value) and value >= 0, name, "a finite number from 0", value)


def _text(value: Any, name: str) -> None:
    _expect(_is_unicode(value), name, "a text", value)


def _is_unicode(value: Any) -> bool:
    """Whether it is a text that can be written: JSON may hold half of a pair of surrogates."""
    return isinstance(value, str) and not any("\ud800" <= letter <= "\udfff" for letter in value)


def _fields(newer: Mapping[str, Kind] = MappingProxyType({}), /, **kinds: Kind) -> Kind:
    """A mapping with at least these names; those that are ``newer`` an older file lacks."""

    def check(value: Any, name: str) -> None:
        _expect(isinstance(value, dict), name, "a mapping", value)
        for field in kinds:
            _expect(field in value, name, f"to have {field}", list(value))
        for field, kind in {**newer, **kinds}.items():
            if field in value:
                kind(value[field], f"{name}.{field}")

    return check


def _by_name(kind: Kind) -> Kind:
    """A mapping of any names."""

    def check(value: Any, name: str) -> None:
        _expect(isinstance(value, dict), name, "a mapping", value)
        for field, one in value.items():
            _text(field, f"a name of {name}")
            kind(one, f"{name}.{field}")

    return check


def _list(kind: Kind, size: int | None = None) -> Kind:
    def check(value: Any, name: str) -> None:
        fits = isinstance(value, list) and size in (None, len(value))
        _expect(fits, name, "a list" if size is None else f"a list of {size}", value)
        for position, one in enumerate(value):
            kind(one, f"{name}[{position}]")

    return check


def _optional(kind: Kind) -> Kind:
    def check(value: Any, name: str) -> None:
        if value is not None:
            kind(value, name)

    return check


def _anything(value: Any, name: str) -> None:
    """Of no kind of its own."""


COUNT, STAMP, EVIDENCE = _whole(0, MOST), _whole(-WHOLE, WHOLE), _by_name(_number)
POSE = _list(_list(_number, 4), 4)
CONSTRAINT = _fields(
    from_ns=STAMP,
    to_ns=STAMP,
    T_from_to=POSE,
    covariance=_list(_list(_number, 6), 6),
    labels=_list(_text),
    evidence=EVIDENCE,
    error=_optional(_fields(rotation_deg=_number, translation_cm=_number)),
)
REFUSAL = _fields(from_ns=STAMP, to_ns=STAMP, T_from_to=_optional(POSE), reason=_text, detail=_text, evidence=EVIDENCE)
RESULT = _fields(
    recording=_text,
    frames=COUNT,
    detections=COUNT,
    objects=COUNT,
    constraints=_list(CONSTRAINT),
    refusals=_list(REFUSAL),
    rejected=_by_name(COUNT),
    stage_ms=_by_name(_fields(p50=_number)),
    findings=_list(_fields(what=_text, cause=_text, todo=_text, anchor=_text)),
    truth=_fields(count=COUNT, strict=COUNT, loose=COUNT, false=COUNT),
    batch=_fields({"revisits": _optional(COUNT)}, made=_by_name(_anything), seconds=_duration, notes=_list(_text)),
)
