# SPDX-License-Identifier: Apache-2.0
"""Where the objects of a label are, in the frame of the session that goes on."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import Relocalised
from objreg_ros.geometry import inverse, transform, turned_about
from objreg_ros.memory.landmark_position import position_of
from objreg_ros.memory.landmarks import Landmark
from objreg_ros.memory.sighting import Sighting

MOST_OBJECTS = 200  # that are answered with, those that were seen last
MOST_LABELS = 30  # that are named


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class KnownObject:
    """A landmark with ``xyz (3,)`` m and its ``covariance (3, 3)`` m^2 in the frame of the session that goes on.

    ``extent`` m is the median diagonal of the box around it.
    """

    landmark: Landmark
    xyz: Array
    covariance: Array
    extent: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class KnownObjects:
    """The objects of a label, those that were seen last first, in the frame of ``session``; None before the first.

    ``message`` says what of them is not here, and which labels there are where none is.
    """

    objects: tuple[KnownObject, ...]
    session: int | None
    message: str


def objects_called(
    label: str,
    landmarks: Sequence[Landmark],
    sightings_of: Callable[[int], Iterable[Sighting]],
    session: int | None,
    relocalised: Relocalised | None,
) -> KnownObjects:
    """The landmarks of ``label``, in small letters or capitals, or all where it is empty.

    Each by those of its sightings (``sightings_of`` its number) that are of the session that saw it last. Left out and
    counted are those of sessions that are neither this one nor that of ``relocalised``: where they are is not known.
    """
    wanted = label.casefold()
    named = [known for known in landmarks if not label or known.label.casefold() == wanted]
    tied = [k for k in named if k.session == session or (relocalised is not None and k.session == relocalised.session)]
    latest = sorted(tied, key=lambda known: (-known.stamp_ns, known.landmark))[:MOST_OBJECTS]
    objects = tuple(_placed(known, sightings_of(known.landmark), session, relocalised) for known in latest)
    return KnownObjects(objects=objects, session=session, message=_message(label, landmarks, named, tied))


def _placed(
    known: Landmark, sightings: Iterable[Sighting], session: int | None, relocalised: Relocalised | None
) -> KnownObject:
    stored = list(sightings)
    own = [sighting for sighting in stored if sighting.session == known.session]
    xyz = np.array([sighting.position for sighting in own] or [known.position])
    extents = np.array([sighting.extent for sighting in own or stored[-1:]])  # those of its session may be forgotten
    position, covariance = position_of(xyz, extents)
    if known.session != session and relocalised is not None:
        position, covariance = _brought_here(position, covariance, relocalised)
    return KnownObject(landmark=known, xyz=position, covariance=covariance, extent=float(np.median(extents)))


def _brought_here(xyz_map: Array, covariance: Array, relocalised: Relocalised) -> tuple[Array, Array]:
    """A position of an earlier map in the odometry of now, and its covariance with that of where the camera is."""
    T_odom_map = inverse(relocalised.T_map_odom)
    lever = xyz_map - relocalised.T_map_camera[:3, 3]
    both = covariance + turned_about(relocalised.covariance, lever)[:3, :3]
    R = T_odom_map[:3, :3]
    return transform(T_odom_map, xyz_map), np.asarray(R @ both @ R.T)


def _message(label: str, landmarks: Sequence[Landmark], named: Sequence[Landmark], tied: Sequence[Landmark]) -> str:
    if not named:
        counts = Counter(known.label for known in landmarks).most_common(MOST_LABELS)
        there = ", ".join(f"{name} ({count})" for name, count in counts) or "no objects yet"
        return f"no {label or 'object'} is known; there are: {there}"
    parts = [f"{len(tied)} here"]
    if len(tied) > MOST_OBJECTS:
        parts.append(f"the {MOST_OBJECTS} that were seen last are given")
    if len(named) > len(tied):
        parts.append(f"{len(named) - len(tied)} in sessions that nothing ties to this one")
    return ", ".join(parts)
