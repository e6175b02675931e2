# SPDX-License-Identifier: Apache-2.0
"""Since when a camera knows an object, and by what: an object that was first seen elsewhere confirms nothing.

A camera that was taken elsewhere sees new objects there, and sees them again. So an object counts in favour of odometry
only once it is old, or where the keyframe that saw it first showed one that counts.
"""

from __future__ import annotations

from collections.abc import Iterable

OLD_NS = 10_000_000_000  # being elsewhere shows by then, or not
MOST = 4096  # objects that are kept, the newest


class Familiar:
    """The landmarks that this camera has seen in its session."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[int, bool]] = {}  # when first seen, and whether beside one that counts

    def counts(self, landmark: int, stamp_ns: int) -> bool:
        """Whether seeing it again says that the camera is where odometry says; what others saw before does."""
        first_ns, linked = self._known.get(landmark, (stamp_ns - OLD_NS, True))
        return linked or stamp_ns - first_ns >= OLD_NS

    def see(self, landmarks: Iterable[int], stamp_ns: int, linked: bool) -> None:
        """Take in the landmarks of a keyframe; ``linked`` where it showed one that counts, or a closure tied it."""
        for landmark in landmarks:
            first_ns, before = self._known.get(landmark, (stamp_ns, False))
            self._known[landmark] = first_ns, before or linked
        while len(self._known) > MOST:
            del self._known[next(iter(self._known))]
