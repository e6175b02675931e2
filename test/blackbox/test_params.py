# SPDX-License-Identifier: Apache-2.0
"""The parameters of the black box."""

from __future__ import annotations

import pytest

from objreg_ros.blackbox.params import BlackboxParams


def test_it_is_off_until_it_is_asked_for() -> None:
    assert BlackboxParams().blackbox_seconds == 0.0


def test_no_more_is_kept_in_memory_than_a_file_may_have() -> None:
    assert BlackboxParams(blackbox_memory=500.0, blackbox_megabytes=20.0).most_kept == 20_000_000
    assert BlackboxParams(blackbox_memory=5.0, blackbox_megabytes=20.0).most_kept == 5_000_000


def test_a_reason_that_there_is_not_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(ValueError, match=r"blackbox_reasons: expected some of .*low_overlap.*, got 'bad luck'"):
        BlackboxParams(blackbox_reasons=("bad luck",))
