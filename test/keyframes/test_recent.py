# SPDX-License-Identifier: Apache-2.0
"""The keyframes that stay in memory."""

from __future__ import annotations

from registration.samples import keyframe

from objreg_ros.keyframes.recent import RecentKeyframes

BYTES = keyframe().nbytes


def test_what_was_not_used_for_longest_goes_first() -> None:
    recent = RecentKeyframes(2 * BYTES)
    first, second, third = (keyframe(number) for number in (1, 2, 3))
    recent.keep(first)
    recent.keep(second)
    assert recent.get(1) is first
    recent.keep(third)
    assert (recent.get(1), recent.get(2), recent.get(3)) == (first, None, third)
    assert recent.nbytes == 2 * BYTES


def test_one_that_is_too_large_is_kept_alone() -> None:
    recent = RecentKeyframes(BYTES // 2)
    for number in (1, 2):
        recent.keep(keyframe(number))
    assert recent.get(1) is None and recent.get(2) is not None and recent.nbytes == BYTES


def test_the_same_keyframe_counts_once_and_what_is_dropped_does_not() -> None:
    recent = RecentKeyframes()
    for _ in range(3):
        recent.keep(keyframe(1))
    assert recent.nbytes == BYTES
    recent.drop(1)
    recent.drop(2)
    assert recent.nbytes == 0 and recent.get(1) is None
    recent.keep(keyframe(1))
    recent.clear()
    assert recent.nbytes == 0
