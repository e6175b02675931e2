# SPDX-License-Identifier: Apache-2.0
"""What closures say of two sessions of a store: how the frame of the one lies in that of the other."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import LoopClosure
from objreg_ros.geometry import inverse, rotation_angle
from objreg_ros.memory.sighting import Sighting
from objreg_ros.memory.store import Store, StoreError

MOST = 30  # ties of two sessions that are read, spread evenly over their closures
TURN_M = 1.0  # how many metres a radian counts where ties are compared


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SessionTie:
    """A closure between two sessions, the ``earlier`` and the ``later``.

    ``T_earlier_later (4, 4)`` maps points of the later session's frame into that of the earlier; ``earlier_camera`` and
    ``later_camera (3,)`` m are where the cameras were, each in the frame of its own session.
    """

    earlier: int
    later: int
    T_earlier_later: Array
    earlier_camera: Array
    later_camera: Array


def ties_in(store: Store, sightings: Sequence[Sighting]) -> tuple[SessionTie, ...]:
    """The closures of a store that join two sessions, at most `MOST` of any two.

    Left out are those whose keyframes are not stored any more, have no pose, or are damaged. StoreError where the store
    cannot be read.
    """
    ids = {(sighting.session, sighting.stamp_ns): sighting.keyframe_id for sighting in sightings}
    joining: defaultdict[tuple[int, int], list[LoopClosure]] = defaultdict(list)
    for closure in store.closures():
        before, after = closure.from_session, closure.to_session
        if before is None or after is None or before == after:
            continue
        if (before, closure.from_ns) in ids and (after, closure.to_ns) in ids:
            joining[min(before, after), max(before, after)].append(closure)
    ties = (
        _tie(store, ids, closures[k])
        for closures in joining.values()
        for k in np.unique(np.linspace(0, len(closures) - 1, min(len(closures), MOST)).round().astype(int)).tolist()
    )
    return tuple(tie for tie in ties if tie is not None)


def _tie(store: Store, ids: dict[tuple[int, int], int], closure: LoopClosure) -> SessionTie | None:
    assert closure.from_session is not None and closure.to_session is not None
    ends = (closure.from_session, closure.from_ns), (closure.to_session, closure.to_ns)
    try:
        T_from, T_to = (store.keyframe(ids[end]).T_odom_camera for end in ends)
    except StoreError:
        return None
    if T_from is None or T_to is None:
        return None
    T_from_to = T_from @ closure.T_from_to @ inverse(T_to)
    forward = closure.from_session < closure.to_session
    cameras = T_from[:3, 3], T_to[:3, 3]
    return SessionTie(
        earlier=min(closure.from_session, closure.to_session),
        later=max(closure.from_session, closure.to_session),
        T_earlier_later=T_from_to if forward else inverse(T_from_to),
        earlier_camera=cameras[not forward],
        later_camera=cameras[forward],
    )


def joined(ties: Sequence[SessionTie]) -> list[dict[int, Array]]:
    """The groups of sessions that ties hold together, ``T_first_session (4, 4)`` of each by its number, oldest first.

    A session is joined by the two sessions that have most ties, and by the one of these that agrees best with the
    others. Sessions without a tie are in no group.
    """
    of_two: defaultdict[tuple[int, int], list[SessionTie]] = defaultdict(list)
    for tie in ties:
        of_two[tie.earlier, tie.later].append(tie)
    strongest = sorted(of_two, key=lambda pair: (-len(of_two[pair]), pair))
    left, groups = {session for pair in of_two for session in pair}, []
    while left:
        group = {min(left): np.eye(4)}
        while step := next((pair for pair in strongest if (pair[0] in group) != (pair[1] in group)), None):
            earlier, later = step
            T_earlier_later = _middle([tie.T_earlier_later for tie in of_two[step]])
            if earlier in group:
                group[later] = group[earlier] @ T_earlier_later
            else:
                group[earlier] = group[later] @ inverse(T_earlier_later)
        groups.append(dict(sorted(group.items())))
        left -= group.keys()
    return groups


def _middle(poses: Sequence[Array]) -> Array:
    """The one of several poses (4, 4) to which the others are nearest."""
    return min(poses, key=lambda T: sum(min(_apart(T, other), 1.0) for other in poses))


def _apart(T: Array, other: Array) -> float:
    between = inverse(T) @ other
    return float(np.linalg.norm(between[:3, 3])) + TURN_M * float(rotation_angle(between[:3, :3]))
