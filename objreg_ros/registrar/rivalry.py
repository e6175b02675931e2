# SPDX-License-Identifier: Apache-2.0
"""Two places that fit alike: of poses that cannot both be true neither is published until something decides.

The gate sees one pair of keyframes, and accepts equal desks as one desk. Here a pose has rivals: poses of the same
keyframe in another place of the same map, farther away than that map's odometry may err. What decides is how the views
differ in their cells (`score/differing_parts`), added up over the keyframes of a session; then where the session is
tied to the map. A place whose twin is not stored has no rival.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverse, pose_error, transform
from objreg_ros.registrar.closure import Decision
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.relocalisation import Relocalisation
from objreg_ros.registration.keyframe import Keyframe
from objreg_ros.registration.score.differing_parts import differing_parts

LEAST_M, LEAST_DEG = 0.5, 30.0  # between poses that are two places, and more where odometry may err by more
DEVIATIONS = 3.0  # of odometry
LEAST_LEAD = 3  # keyframes by which one place leads, that decide
LEAST_TIMES = 3.0  # as many as for the other; and the pixels of one keyframe
SAME_SPOT_M = 0.3  # between objects that are one: who shows it shows no other place
LEAST_PX = 25  # of a view, that speak for a place
TIED_BY = 3  # closures that agree, to a map: one may be of the twin


class Place(NamedTuple):
    """One of the places that a camera may be in: ``T_map_odom (4, 4)`` then, into the frame of the map's session."""

    session: int
    T_map_odom: Array


@dataclass(eq=False)
class _Tally:
    """How many keyframes of a session spoke for one place and for another."""

    one: Place
    other: Place
    votes: Array = field(default_factory=lambda: np.zeros(2))


class Rivalry:
    """What speaks for which of rival places, of the camera whose ``relocalisation`` this is."""

    def __init__(self, relocalisation: Relocalisation) -> None:
        self._relocalisation = relocalisation
        self._session = -1
        self._tallies: list[_Tally] = []

    def winner(self, source: Keyframe, one: Decision, other: Decision) -> tuple[Decision | None, str]:
        """Which of two rivals (see `apart`) is right, None where nothing decides, and by what it is known."""
        if source.session != self._session:
            self._session, self._tallies = source.session, []
        votes = self._counted(source, one, other)
        said = f"{votes[0]:.0f} keyframes speak for one place, {votes[1]:.0f} for the other"
        if _leads(*votes):
            return one, said
        if _leads(*votes[::-1]):
            return other, said
        near = [self._is_expected(source, two) for two in (one, other)]
        if near[0] != near[1]:
            return (one if near[0] else other), f"{said}, and the tie to the map"
        return None, said

    def doubt(self, source: Keyframe, one: Decision) -> str:
        """Why a pose is not believed though this keyframe shows no rival: its place has one, of an earlier keyframe of
        the session, that is not ruled out. Empty where it is believed.
        """
        if source.session != self._session:
            return ""
        place = place_of(source, one)
        for tally in self._tallies:
            for mine, theirs, of in ((0, 1, tally.one), (1, 0, tally.other)):
                if self._same(source, place, of) and not _leads(tally.votes[mine], tally.votes[theirs]):
                    votes = tally.votes[[mine, theirs]]
                    return f"{votes[0]:.0f} keyframes speak for this place, {votes[1]:.0f} for one that fitted as well"
        return ""

    def _counted(self, source: Keyframe, one: Decision, other: Decision) -> Array:
        """The votes (2,) of the session for either, with those of this keyframe."""
        first, second = one.target.view, other.target.view
        T_first, T_second = one.candidate.T_target_source, other.candidate.T_target_source
        parts = np.array(differing_parts(source.view, first, T_first, second, T_second))
        new = ((parts >= LEAST_PX) & (parts >= LEAST_TIMES * parts[::-1])).astype(float)
        places = place_of(source, one), place_of(source, other)
        for tally in self._tallies:
            for order in ((0, 1), (1, 0)):
                two = [(tally.one, tally.other)[k] for k in order]
                if all(self._same(source, a, b) for a, b in zip(places, two, strict=True)):
                    tally.votes += new[list(order)]
                    return tally.votes[list(order)]
        self._tallies.append(_Tally(*places, new))
        return self._tallies[-1].votes

    def _same(self, source: Keyframe, one: Place, other: Place) -> bool:
        """Whether two statements of where the odometry of a session lies in a map are of one place."""
        if one.session != other.session:
            return False
        here = _pose_of(source)
        degrees, centimetres = pose_error(one.T_map_odom @ here, other.T_map_odom @ here)
        return degrees < 2 * LEAST_DEG and 0.01 * centimetres < 4 * LEAST_M

    def _is_expected(self, source: Keyframe, one: Decision) -> bool:
        """Whether the camera is there by where the session is tied to the map."""
        tied = self._relocalisation.relocalised
        if (
            tied is None
            or tied.closures < TIED_BY
            or tied.session != one.target.session
            or source.session == one.target.session
        ):
            return False
        return self._same(source, place_of(source, one), Place(tied.session, tied.T_map_odom))


def apart(one: Keyframe, T_one_source: Array, other: Keyframe, T_other_source: Array, params: RegistrarParams) -> bool:
    """Whether poses in two stored keyframes cannot both be true: odometry of their session does not err by so much.

    False where they are of two sessions, or odometry gave no poses: then nothing is known.
    """
    if one.session != other.session or not (one.by_odometry and other.by_odometry):
        return False
    path, turn = abs(one.travelled - other.travelled), abs(one.turned - other.turned)
    sigma_m = params.odometry_translation_noise + params.odometry_drift * path
    sigma_deg = params.odometry_rotation_noise + params.odometry_rotation_drift * turn
    degrees, centimetres = pose_error(_pose_of(one) @ T_one_source, _pose_of(other) @ T_other_source)
    far_m, far_deg = max(LEAST_M, DEVIATIONS * sigma_m), max(LEAST_DEG, DEVIATIONS * sigma_deg)
    return 0.01 * centimetres > far_m or degrees > far_deg


def rivals(one: Decision, other: Decision, params: RegistrarParams) -> bool:
    """Whether the poses of two decisions cannot both be true."""
    T_one, T_other = one.candidate.T_target_source, other.candidate.T_target_source
    return apart(one.target, T_one, other.target, T_other, params)


def may_rival(source: Keyframe, one: Decision, stored: Keyframe, params: RegistrarParams) -> bool:
    """Whether a stored keyframe shows another place than where a decision has the camera, and none of what is there."""
    if not apart(one.target, one.candidate.T_target_source, stored, np.eye(4), params):
        return False
    here, there = _objects(source, T_map_camera(one)), _objects(stored, _pose_of(stored))
    return not bool((np.linalg.norm(here[:, None] - there[None], axis=2) < SAME_SPOT_M).any())


def _objects(keyframe: Keyframe, T_map_camera: Array) -> Array:
    """The middles (N, 3) of its objects in a map."""
    return np.asarray(transform(T_map_camera, np.reshape([one.centroid for one in keyframe.objects], (-1, 3))))


def place_of(source: Keyframe, one: Decision) -> Place:
    """Where a decision has the odometry of a keyframe in the map."""
    return Place(one.target.session, T_map_camera(one) @ inverse(_pose_of(source)))


def T_map_camera(one: Decision) -> Array:
    """(4, 4) of the new keyframe in the frame of the target's session."""
    return np.asarray(_pose_of(one.target) @ one.candidate.T_target_source)


def _leads(votes: float, others: float) -> bool:
    return votes - others >= LEAST_LEAD and votes >= LEAST_TIMES * others


def _pose_of(keyframe: Keyframe) -> Array:
    return np.eye(4) if keyframe.T_odom_camera is None else keyframe.T_odom_camera
