# SPDX-License-Identifier: Apache-2.0
"""A person who reads a reason can read what it means."""

from __future__ import annotations

from objreg_ros.data import Reason
from objreg_ros.report.reasons import MEANINGS


def test_every_reason_has_its_meaning() -> None:
    assert set(MEANINGS) == {reason.value for reason in Reason}
