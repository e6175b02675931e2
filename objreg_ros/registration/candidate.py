# SPDX-License-Identifier: Apache-2.0
"""What the engine hands to the gate: a pose between two keyframes and the evidence for and against it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import Alignment


class ObjectPair(NamedTuple):
    """Object ``source`` of the source keyframe against object ``target`` of the target keyframe, by index."""

    source: int
    target: int
    label: str


class Score(NamedTuple):
    """What candidates are ranked by, term by term. The unit is that of the view score V, and so is the ``total``."""

    view: float  # V
    matches: float  # what objects add that lie upon each other, less those that moved
    silhouettes: float  # the weighted silhouette score of the matched objects

    @property
    def total(self) -> float:
        """The sum of the terms."""
        return self.view + (self.matches + self.silhouettes)


@dataclass(frozen=True, slots=True, kw_only=True)
class Verification:
    """How well two views agree under a pose, looked at both ways: each field is the worse way's, except ``tested``.

    Of the ``tested`` pixels that land in the other view (both ways together), ``inliers`` is the share whose depth
    agrees, ``violations`` the share that floats in space which the other view saw to be free, ``occluded`` the share
    hidden behind something. ``correlation`` is that, -1..1, of the high-passed grey of the inliers, None without
    grey. ``score`` is V: higher is better, and above 0 is more evidence for than against.
    """

    inliers: float
    violations: float
    occluded: float
    correlation: float | None
    tested: int
    score: float


class KeypointAgreement(NamedTuple):
    """``matches`` of keypoints that a pose brings together, and the ``cells`` of the pictures in which they lie: the
    smaller number of the two. ``rival_matches`` and ``rival_cells`` are the most that any other pose has.
    """

    matches: int
    cells: int
    rival_matches: int
    rival_cells: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Candidate:
    """One hypothesis after refinement, with its evidence. It decides nothing: the gate does.

    ``proposer`` proposed it, ``agreeing_proposers`` (``proposer`` among them) came to the same pose independently;
    ``matched`` are the object pairs that lie upon each other under it, ``moved`` those of the same kind that should and
    do not although both views look there; ``gravity_error_deg`` is the angle between the two gravities under it, None
    where one is unknown; ``silhouette_score`` is that of the matched objects, -1..1, None where it is unknown, and
    ``silhouettes`` that of each a little aside, where it looks most alike: what it is, if not where;
    ``yaw_known`` says that the shape of one of them fixes its yaw; ``score_margin`` is how much higher the
    candidate scores than any other. ``perturbation_margin`` is the score margin over the pose perturbed to where it
    would be false, along the directions in which it is known least; None where it is known well enough without.
    ``surroundings`` is what the views say of it without the objects that it matches; None where those are small in
    both, and where they are none, or so many that they would not move together. ``systematic_depth_error (6, 6)`` is
    the covariance [t r] that it adds to the alignment's. ``certain_violations`` is the share of the tested pixels that
    float in seen free space beyond doubt. ``keypoints`` is what matched keypoints say, None where there are hardly any.
    """

    alignment: Alignment
    proposer: str
    agreeing_proposers: tuple[str, ...]
    verification: Verification
    matched: tuple[ObjectPair, ...] = ()
    moved: tuple[ObjectPair, ...] = ()
    gravity_error_deg: float | None = None
    gravity_error_sigmas: float = 0.0
    silhouette_score: float | None = None
    silhouettes: float | None = None
    yaw_known: bool = False
    score_margin: float = 0.0
    perturbation_margin: float | None = None
    surroundings: Verification | None = None
    certain_violations: float = 1.0
    keypoints: KeypointAgreement | None = None
    systematic_depth_error: Array = field(default_factory=lambda: np.zeros((6, 6)))

    @property
    def T_target_source(self) -> Array:
        """The pose: maps points of the source keyframe's camera into the target keyframe's camera."""
        return self.alignment.T_target_source
