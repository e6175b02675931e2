# SPDX-License-Identifier: Apache-2.0
"""The keyframes of a store with where they are on a corrected map: that of a run, or that of the store itself."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from objreg_mapper.params import MapperParams
from objreg_ros.data.checked import Array
from objreg_ros.memory.store import Store
from objreg_ros.memory.store_file import StoreError
from objreg_ros.registration.keyframe import Keyframe
from objreg_tools.report.run.camera_map import CameraMap, MappedFrame, TrackedFrame

SAME_POSE = 1e-6  # m, and of the entries of a rotation


@dataclass(frozen=True, slots=True, eq=False)
class PlacedKeyframes:
    """The keyframes of the store at ``path`` that are among the ``frames`` of a map, the oldest first.

    ``by_odometry`` takes those alone whose pose odometry gave, or our own tracking; all where it is None.
    """

    path: Path
    frames: tuple[MappedFrame, ...]
    by_odometry: bool | None = None

    def __iter__(self) -> Iterator[tuple[Keyframe, Array]]:
        """Each keyframe with ``T_map_camera (4, 4)``. StoreError where the store cannot be read."""
        for keyframe, T_map_camera in self.all():
            if T_map_camera is not None:
                yield keyframe, T_map_camera

    def all(self, notify: Callable[[str], None] = lambda line: None) -> Iterator[tuple[Keyframe, Array | None]]:
        """Likewise, and those that are not on the map with None; ``notify`` receives which are damaged."""
        at: defaultdict[int, list[MappedFrame]] = defaultdict(list)
        for frame in self.frames:
            at[frame.stamp_ns].append(frame)
        for keyframe in stored_keyframes(self.path, notify):
            yield keyframe, self._placed(keyframe, at[keyframe.stamp_ns])

    def _placed(self, keyframe: Keyframe, frames: Iterable[MappedFrame]) -> Array | None:
        """``T_map_camera``; None for a keyframe of another run, or one that is not of the trajectory."""
        if self.by_odometry not in (None, keyframe.by_odometry) or keyframe.T_odom_camera is None:
            return None
        own = (f for f in frames if np.allclose(keyframe.T_odom_camera, f.T_session_camera, rtol=0.0, atol=SAME_POSE))
        return next((frame.T_map_camera for frame in own), None)


def placed_in_store(path: Path, notify: Callable[[str], None] = lambda line: None) -> PlacedKeyframes:
    """The keyframes of the largest part of a store that closures tie into one frame, that of its longest session.

    ``notify`` receives what is left out. StoreError where the store cannot be read.
    """
    frames, tracked = list[TrackedFrame](), False
    for keyframe in stored_keyframes(path, notify):
        if keyframe.T_odom_camera is not None:
            frames.append(TrackedFrame(keyframe.stamp_ns, keyframe.session, keyframe.T_odom_camera))
            tracked |= not keyframe.by_odometry
    frames = _advancing(frames)
    store = Store(path, read_only=True)
    try:
        closures = list(store.closures())
    finally:
        store.close()
    found = CameraMap.of(frames, closures, MapperParams.of_tracking() if tracked else None)
    if found.frames_apart:
        notify(f"{found.frames_apart} keyframes of {found.sessions_apart} sessions are tied to no others: left out")
    if found.unsolved:
        notify(f"not corrected: {found.unsolved}")
    return PlacedKeyframes(path, found.frames)


def _advancing(frames: Iterable[TrackedFrame]) -> list[TrackedFrame]:
    """The frames by session, and in each by their stamps, without a stamp that was there before."""
    known = {(frame.session, frame.stamp_ns): frame for frame in frames}
    return [known[key] for key in sorted(known)]


def stored_keyframes(path: Path, notify: Callable[[str], None]) -> Iterator[Keyframe]:
    """The keyframes of a store, the oldest first; those that are damaged are left out and reported."""
    store = Store(path, read_only=True)
    try:
        for keyframe_id in store.keyframe_ids():
            try:
                keyframe = store.keyframe(keyframe_id)
            except StoreError as error:
                notify(f"keyframe {keyframe_id} is left out: {error}")
                continue
            yield keyframe
    finally:
        store.close()
