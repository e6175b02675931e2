# SPDX-License-Identifier: Apache-2.0
"""Closures and refusals as plain values under the names of their fields, and back: what JSON can hold.

The store, saved maps, the JSON of a run and exports are made of these. A new field of `LoopClosure` or `Rejected` needs
a line in `READ`, and then is in all of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from enum import Enum
from typing import Any

import numpy as np

from objreg_ros import limits
from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure, ObjectMatch, Reason, Rejected


def fields_of(closure: LoopClosure | Rejected) -> dict[str, Any]:
    """Every field by its name: numbers, texts, lists, mappings and None."""
    return {field.name: _plain(getattr(closure, field.name)) for field in fields(closure)}


def closure_of(known: Mapping[str, Any]) -> LoopClosure:
    """The closure of such fields, those that are missing by their defaults; other names are passed over.

    ValueError with the name of a field that holds something else or that every closure has.
    """
    return LoopClosure(**_read(LoopClosure, known))


def rejected_of(known: Mapping[str, Any]) -> Rejected:
    """The refusal of such fields, as in `closure_of`."""
    return Rejected(**_read(Rejected, known))


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    if isinstance(value, ObjectMatch):
        return {"label": value.label, "object_id": value.object_id}
    return dict(value) if isinstance(value, Mapping) else value


def _read(kind: type[LoopClosure] | type[Rejected], known: Mapping[str, Any]) -> dict[str, Any]:
    values = {}
    for field in fields(kind):
        if field.name not in known:
            continue  # the data type asks for what has no default
        try:
            values[field.name] = READ[field.name](known[field.name])
        except (TypeError, ValueError, KeyError, AttributeError, OverflowError) as error:
            got = " ".join(repr(known[field.name]).split())[:60]
            raise ValueError(f"{field.name}: expected that of a closure, got {got} ({error})") from error
    lacking = [name for name in ALWAYS[kind] if name not in values]
    if lacking:
        raise ValueError(f"expected {', '.join(lacking)} of a closure, got none")
    return values


def _stamp(value: Any) -> int:
    if type(value) is not int or not limits.LEAST_STAMP_NS <= value <= limits.MOST_STAMP_NS:
        raise ValueError("expected a stamp that ROS has, in ns")
    return value


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise ValueError("expected text")
    return value


def _session(value: Any) -> int | None:
    if value is None or type(value) is int:
        return value
    raise ValueError("expected a number or nothing")


def _numbers(value: Any) -> Array:
    return np.array(value, float)


def _pose(value: Any) -> Array:
    """(4, 4); of a refusal it may be no rigid motion, and is for a look only."""
    T = _numbers(value)
    if T.shape != (4, 4):
        raise ValueError(f"expected 4 x 4 numbers, got {T.shape}")
    return T


def _pose_or_none(value: Any) -> Array | None:
    if value is None:
        return None
    T = _pose(value)
    return T if np.isfinite(T).all() else None


def _labels(value: Any) -> tuple[str, ...]:
    return tuple(map(_text, value))


def _evidence(value: Any) -> dict[str, float]:
    return {_text(name): float(number) for name, number in value.items()}


def _objects(value: Any) -> tuple[ObjectMatch, ...]:
    return tuple(ObjectMatch(label=_text(item["label"]), object_id=int(item["object_id"])) for item in value)


READ: dict[str, Callable[[Any], Any]] = {
    **{f"{end}_ns": _stamp for end in ("from", "to")},
    **{f"{end}_frame_id": _text for end in ("from", "to")},
    **{f"{end}_session": _session for end in ("from", "to")},
    **{f"{end}_robot": _text for end in ("from", "to")},
    "T_from_to": _pose_or_none,
    "covariance": _numbers,
    "labels": _labels,
    "objects": _objects,
    "evidence": _evidence,
    "reason": Reason,
    "detail": _text,
}
ALWAYS = {
    LoopClosure: ("from_ns", "to_ns", "T_from_to", "covariance", "labels"),
    Rejected: ("reason", "from_ns", "to_ns", "detail"),
}
