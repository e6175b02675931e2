# SPDX-License-Identifier: Apache-2.0
"""LIO-SAM is given two moments."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from objreg_mapper.formats.lio_sam import fill_loop

from .blank import closure


@pytest.mark.parametrize("moments", [(1_500_000_000, 63_250_000_000), (63_250_000_000, 1_500_000_000)])
def test_the_later_moment_comes_first_and_there_are_two_numbers(moments: tuple[int, int]) -> None:
    assert fill_loop(SimpleNamespace(), closure(*moments)).data == pytest.approx([63.25, 1.5])
