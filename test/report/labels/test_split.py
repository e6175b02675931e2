# SPDX-License-Identifier: Apache-2.0
"""Blocks of time train and validate."""

from __future__ import annotations

from itertools import groupby

from objreg_tools.report.labels.split import TRAIN, VAL, split

STAMPS = [k * 100_000_000 for k in range(1000)]  # 100 s at 10 Hz


def test_a_fifth_validates_in_two_blocks() -> None:
    parts = split(STAMPS)
    assert [name for name, _ in groupby(parts)] == [TRAIN, "", VAL, "", TRAIN, "", VAL, "", TRAIN]
    assert parts.count(VAL) == 200


def test_no_picture_trains_within_half_a_second_of_one_that_validates() -> None:
    parts = split(STAMPS)
    of = {name: [s for s, part in zip(STAMPS, parts, strict=True) if part == name] for name in (TRAIN, VAL)}
    assert min(abs(a - b) for a in of[TRAIN] for b in of[VAL]) > 500_000_000


def test_a_short_run_is_split_as_well_and_an_empty_one_has_no_parts() -> None:
    assert split([]) == [] and split([7]) == [TRAIN]
    assert {TRAIN, VAL} <= set(split(STAMPS[:20]))
