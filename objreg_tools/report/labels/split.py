# SPDX-License-Identifier: Apache-2.0
"""Which pictures train and which validate: blocks of time, since neighbouring pictures are nearly the same."""

from __future__ import annotations

from collections.abc import Sequence

TRAIN, VAL = "train", "val"
BLOCKS = 10  # of a run
OF_VAL = (3, 8)  # the blocks that validate, a fifth of the time: in the middle of either half
GAP_NS = 500_000_000  # beside a block that validates no picture trains: it would show nearly the same


def split(stamps_ns: Sequence[int]) -> list[str]:
    """`TRAIN` or `VAL` for each of the stamps, which rise; empty for one that is left out between two blocks."""
    if not stamps_ns:
        return []
    first, length = stamps_ns[0], max(1, stamps_ns[-1] - stamps_ns[0] + 1)
    ends = [(first + length * k // BLOCKS, first + length * (k + 1) // BLOCKS) for k in OF_VAL]
    gap = min(GAP_NS, length // (4 * BLOCKS))
    return [_part(stamp, ends, gap) for stamp in stamps_ns]


def _part(stamp_ns: int, of_val: Sequence[tuple[int, int]], gap: int) -> str:
    if any(start <= stamp_ns < end for start, end in of_val):
        return VAL
    return "" if any(start - gap <= stamp_ns < end + gap for start, end in of_val) else TRAIN
