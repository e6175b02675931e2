# SPDX-License-Identifier: Apache-2.0
"""Columns of whole numbers come back, and are never read beyond the end."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.keyframes.columns import Columns, column

MOST = 2**31 - 1


@pytest.mark.parametrize("numbers", [[], [0], [-1, 1, 63, -64], [-128, 200], [70_000, -70_000], [MOST, -MOST]])
def test_whole_numbers_of_any_size_come_back(numbers: list[int]) -> None:
    columns = Columns(column(np.array(numbers, np.int64)) + column(np.arange(3)))
    assert columns.next_column(len(numbers)).tolist() == numbers
    assert columns.next_column(3).tolist() == [0, 1, 2]
    columns.require_end()


def test_small_numbers_take_a_byte_each() -> None:
    assert len(column(np.full(1000, -64))) == 1001
    assert len(column(np.full(1000, 1000))) == 2001


@pytest.mark.parametrize("body", [b"\x00aaaa", b"\x05aaaaaaaaaaaaaaaaaaaaaaaa", b"\x02aaaaaaa", b"\xff" * 100])
def test_a_column_that_is_none_or_too_short_is_refused(body: bytes) -> None:
    with pytest.raises(ValueError, match="expected 4 numbers of 1 to 4 bytes, got"):
        Columns(body).next_column(4)


def test_more_than_there_is_takes_no_memory() -> None:
    with pytest.raises(ValueError, match="and too few"):
        Columns(b"\x04" + bytes(64)).next_column(10**15)


def test_bytes_that_are_left_are_refused() -> None:
    columns = Columns(column(np.arange(4)) + b"x")
    columns.next_column(4)
    with pytest.raises(ValueError, match="that ends, got 1 bytes more"):
        columns.require_end()
