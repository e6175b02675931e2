# SPDX-License-Identifier: Apache-2.0
"""Closures and refusals go through plain values and JSON and come back as they were, field by field."""

from __future__ import annotations

import json
from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from objreg_ros.data.closure_fields import READ, closure_of, fields_of, rejected_of
from objreg_ros.data.closures import LoopClosure, ObjectMatch, Reason, Rejected
from objreg_ros.geometry import pose, rotation_from_vector

ENDS: dict[str, Any] = {
    "from_ns": 5,
    "to_ns": 2**62 // 2**31,
    "from_frame_id": "front",
    "to_frame_id": "rear",
    "from_session": 3,
    "to_session": 0,
    "from_robot": "robot1",
    "to_robot": "robot2",
    "T_from_to": pose(rotation_from_vector(np.array([0.1, -2.0, 0.3])), np.array([1.0, 2.0, 1 / 3])),
    "evidence": {"odds": 300.5, "inliers": 1 / 3},
}
CLOSURE = LoopClosure(
    **ENDS,
    covariance=np.diag(np.linspace(1e-4, 7e-4, 6)),
    labels=("cup", "book"),
    objects=(ObjectMatch(label="cup", object_id=7),),
)
REJECTED = Rejected(**ENDS, reason=Reason.SLACK, detail="along x")


def differing(one: Any, other: Any) -> list[str]:
    """The fields in which two values of one type differ."""

    def said(value: Any) -> Any:
        return [(m.label, m.object_id) for m in value] if value and isinstance(value[0], ObjectMatch) else value

    pairs = ((field.name, getattr(one, field.name), getattr(other, field.name)) for field in fields(one))
    return [
        name
        for name, a, b in pairs
        if not (
            np.array_equal(a, b) if isinstance(a, np.ndarray) else a == b if name != "objects" else said(a) == said(b)
        )
    ]


def test_every_field_is_another_than_its_default_here_and_comes_back_through_json() -> None:
    for value, read in ((CLOSURE, closure_of), (REJECTED, rejected_of)):
        defaults = {field.name: field.default for field in fields(value)}
        assert not [name for name, default in defaults.items() if getattr(value, name) is default]
        assert differing(value, read(json.loads(json.dumps(fields_of(value))))) == []


def test_no_field_is_forgotten() -> None:
    assert set(READ) == {field.name for kind in (LoopClosure, Rejected) for field in fields(kind)}


def test_what_is_missing_is_as_by_default_and_other_names_are_passed_over() -> None:
    known = {name: fields_of(CLOSURE)[name] for name in ("from_ns", "to_ns", "T_from_to", "covariance", "labels")}
    closure = closure_of({**known, "error": None})
    assert closure.from_robot == "" and closure.from_session is None and closure.objects == ()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("from_ns", 1.5), ("to_ns", 2**80), ("from_ns", True), ("labels", [3]), ("objects", [{"label": "cup"}]),
        ("evidence", {"odds": "many"}), ("T_from_to", [1.0]), ("from_robot", None), ("to_session", "one"),
    ],
)  # fmt: skip
def test_another_value_is_refused_by_the_name_of_its_field(name: str, value: Any) -> None:
    with pytest.raises(ValueError, match=name):
        closure_of({**fields_of(CLOSURE), name: value})


def test_a_closure_without_a_pose_is_refused_and_a_refusal_may_have_none() -> None:
    with pytest.raises(ValueError):
        closure_of({**fields_of(CLOSURE), "T_from_to": None})
    assert rejected_of({**fields_of(REJECTED), "T_from_to": None}).T_from_to is None
    with pytest.raises(ValueError, match="expected detail of a closure, got none"):
        rejected_of({name: value for name, value in fields_of(REJECTED).items() if name != "detail"})
