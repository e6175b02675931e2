# SPDX-License-Identifier: Apache-2.0
"""Tests of which simulated looks are shown to each other."""

from __future__ import annotations

import numpy as np
import pytest


@pytest.mark.parametrize(("labels", "rooms", "count"), [(("box",), 5, 8), (("box", "can", "cup"), 4, 30)])
def test_strangers_are_pairs_of_different_rooms_and_no_pair_comes_twice(
    labels: tuple[str, ...], rooms: int, count: int
) -> None:
    from looks import strangers

    looks = [(label, room) for label in labels for room in range(rooms)]
    pairs = strangers(looks, count, np.random.default_rng(3))
    alike = sum(first[0] == second[0] for first, second in pairs)
    assert len(pairs) == len({frozenset(pair) for pair in pairs}) == count
    assert all(first[1] != second[1] for first, second in pairs)
    assert alike == (count if len(labels) == 1 else count // 2)


def test_of_few_strangers_all_pairs_are_shown() -> None:
    from looks import strangers

    assert len(strangers([("box", 0), ("can", 1), ("can", 2)], 500, np.random.default_rng(0))) == 3
