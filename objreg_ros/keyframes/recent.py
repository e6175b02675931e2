# SPDX-License-Identifier: Apache-2.0
"""The keyframes that were used last, kept decoded in memory as long as they take no more than so many bytes."""

from __future__ import annotations

from collections import OrderedDict

from objreg_ros.registration.keyframe import Keyframe

MOST_BYTES = 32_000_000  # of about 500 kB a keyframe; one that is read again takes a millisecond


class RecentKeyframes:
    """Keyframes by their ids. The newest is kept whatever it takes; for one thread."""

    def __init__(self, most_bytes: int = MOST_BYTES) -> None:
        self.most_bytes, self.nbytes = most_bytes, 0
        self._kept = OrderedDict[int, Keyframe]()

    def get(self, keyframe_id: int) -> Keyframe | None:
        """The keyframe, which is the last that was used then; None where it is not kept."""
        keyframe = self._kept.get(keyframe_id)
        if keyframe is not None:
            self._kept.move_to_end(keyframe_id)
        return keyframe

    def keep(self, keyframe: Keyframe) -> None:
        """Keep one; those that were not used for longest go."""
        self.drop(keyframe.keyframe_id)
        self._kept[keyframe.keyframe_id] = keyframe
        self.nbytes += keyframe.nbytes
        while self.nbytes > self.most_bytes and len(self._kept) > 1:
            self.nbytes -= self._kept.popitem(last=False)[1].nbytes

    def drop(self, keyframe_id: int) -> None:
        """Keep it no longer."""
        dropped = self._kept.pop(keyframe_id, None)
        self.nbytes -= 0 if dropped is None else dropped.nbytes

    def clear(self) -> None:
        """Keep nothing."""
        self._kept.clear()
        self.nbytes = 0
