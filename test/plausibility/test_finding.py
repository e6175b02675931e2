# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from objreg_ros.plausibility.finding import Finding


def test_a_finding_in_one_line_leaves_out_what_it_does_not_say() -> None:
    assert Finding("a").text == "a" and Finding("a", "b").text == "a: b"
    assert Finding("a", "b", "c", "d").text == "a: b; c"
