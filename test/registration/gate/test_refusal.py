# SPDX-License-Identifier: Apache-2.0
"""What a check answers."""

from __future__ import annotations

import typing

from objreg_ros.data.closures import Reason
from objreg_ros.registration.gate.refusal import Refusal


def test_a_refusal_is_a_reason_with_its_numbers() -> None:
    assert typing.get_args(Refusal) == (Reason, str)
