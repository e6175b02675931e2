# SPDX-License-Identifier: Apache-2.0
"""What a user may set, and what is refused."""

from __future__ import annotations

import pytest

from objreg_mapper.adapters.params import AdapterParams, BodyParams, ToHydraParams


def test_a_mounting_is_a_pose_or_none() -> None:
    assert BodyParams().mounting is None
    mounting = BodyParams(T_base_camera=(0.2, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0)).mounting
    assert mounting is not None and mounting[:3, 3].tolist() == [0.2, 0.0, 0.5]


@pytest.mark.parametrize(
    ("kind", "wrong", "complaint"),
    [
        (BodyParams, {"T_base_camera": (1.0, 2.0)}, "T_base_camera: expected"),
        (AdapterParams, {"input": "closures"}, "input: expected one of auto, loop_closures, constraints"),
        (AdapterParams, {"most_waiting": 0}, "most_waiting: expected 1"),
        (ToHydraParams, {"robot": -1}, "robot: expected 0"),
    ],
)
def test_what_cannot_be_is_refused_with_what_was_expected(kind: type, wrong: dict, complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        kind(**wrong)
