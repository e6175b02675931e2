# SPDX-License-Identifier: Apache-2.0
"""How far a pose may slide where the surfaces let it: as far as its view score falls no lower.

Two views of a table from opposite sides share little but its top, on which one can slide along the other. What stands
on it resists, with too few points to count as surface; yet a pose that was perturbed is seen to be worse. So a pose is
perturbed, and where both ways are clearly worse it is held by the views, to a third of the perturbation. Where its
position is known badly all the same, the views are asked for a better one about it, and then whether they resist it all
around.
"""

from __future__ import annotations

import cv2
import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import transform
from objreg_ros.registration.certainty.perturbation import PerturbedScore, perturbed, square_grid, turned_about
from objreg_ros.registration.prepare.prepared import Prepared
from objreg_ros.registration.refine.photometric_icp import finish
from objreg_ros.registration.score.comparison import score_gain, score_locally
from objreg_ros.registration.score.object_matches import match_objects
from objreg_ros.registration.score.photometric import correlate_views
from objreg_ros.registration.score.view_score import LEAST_SCORE, RANKING_POINTS, score_views, verify

PERTURBATIONS_M = (0.05, 0.1, 0.15)  # how far a pose is moved along a direction to see whether V falls
CLEAR_MARGIN = 0.1  # by which V must fall over a perturbation for the views to resist it
DOUBTFUL_SIGMA_M = 0.006  # a position with a larger deviation is perturbed
SEARCH_STEP_M = 0.05  # of the search for a better place, in the plane where a position is known least
SEARCH_STEPS = 4  # each way
SEARCH_TURNS_DEG = (5.0,)  # about the objects, each way, from which grey finishes a doubtful pose too
SEARCHED = 2  # best places that grey finishes
HOLDING_CORRELATION = 0.5  # of grey from which on the views' resistance counts as information
HOLDING_PERTURBATION_M = 0.06  # longest perturbation by which V must have fallen for that
SIGMA_SHARE = 1.0 / 3.0  # of a perturbation that is clearly resisted: one sigma of a pose that the views hold
AROUND = 8  # ways in which a pose is perturbed to see whether it is resisted
CLEARLY = 0.02  # gain in score for which a pose is left for another
HOPE = 0.3  # of V, what grey may add to a pose by finishing it


def split_directions(
    source: Prepared,
    target: Prepared,
    T_target_source: Array,
    degenerate: Array,
    extent: float,
) -> tuple[Array, Array]:
    """The ``degenerate`` directions (K, 6) that are free, and motions (L, 6) of one sigma along the regularised ones.

    Directions and motions [t r] are of the source camera's pose in the target's axes. ``extent`` m is the lever that
    makes a turn of what was seen comparable to a shift. All are free where the view score of the pose itself is too
    low.
    """
    free, regularised = [], []
    lever = transform(T_target_source, source.middle) - T_target_source[:3, 3]
    perturbed_score = _perturbed_score(source, target, T_target_source) if len(degenerate) else None
    for direction in degenerate:
        unit = direction / _length(direction, lever, extent)
        reach = None if perturbed_score is None else _reach(perturbed_score, unit)
        if reach is None:
            free.append(direction)
        else:
            regularised.append(SIGMA_SHARE * reach * unit)
    return np.reshape(free, (-1, 6)), np.reshape(regularised, (-1, 6))


def _perturbed_score(source: Prepared, target: Prepared, T_target_source: Array) -> PerturbedScore | None:
    """The perturbed score of a pose whose view score the gate accepts; None for any other."""
    seen = verify(source.sight, target.sight, T_target_source)
    return PerturbedScore(source, target, T_target_source) if seen.score >= LEAST_SCORE else None


def margin_under_perturbation(source: Prepared, target: Prepared, T_target_source: Array, C: Array) -> float:
    """The least score margin of the pose when it is perturbed in any direction where it is known least.

    ``C (6, 6)`` [t r] is its covariance in the target's axes. In the plane in which it is largest the pose is perturbed
    all around as far as the last of `PERTURBATIONS_M`, along its errors: a camera that looks at one far object
    goes sideways and turns to keep looking at it.
    """
    angles = np.linspace(0.0, 2.0 * np.pi, AROUND, endpoint=False)
    perturbations = PERTURBATIONS_M[-1] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return PerturbedScore(source, target, T_target_source).least_margin(perturbations @ least_known_motions(C))


def least_known_motions(C: Array) -> Array:
    """The motions (2, 6) [t r] of 1 m along the directions in which a position of covariance (6, 6) is known least."""
    values, vectors = np.linalg.eigh(C[:3, :3])
    return np.asarray((C[:, :3] @ vectors[:, 1:] / values[1:]).T)


def better_pose(source: Prepared, target: Prepared, T_target_source: Array, C: Array) -> Array | None:
    """A pose of a better score of views and objects where one of covariance ``C (6, 6)`` could as well be, or None.

    Far away a shift looks like a turn, and what repeats itself looks alike on either side of the truth: a pose may come
    to rest beside it. So the views are asked all over the plane in which the position is known least, and what scores
    best there, aside from the pose itself, is finished by grey; and so is the pose turned about the objects, which is
    taken as it is too, as grey leads astray where it says little. The objects have a say as far as the grey leaves
    doubt (`comparison`), as views of little in common score a wrong pose a hair higher. Nothing is preferred without
    grey, nor to a pose beyond what grey may mend.
    """
    if not (source.sight.textured and target.sight.textured):
        return None
    matched, _ = match_objects(source, target, T_target_source)
    own = score_locally(source, target, T_target_source, matched)
    if own.seen.score < LEAST_SCORE - 2.0 * HOPE:
        return None
    poses = perturbed(T_target_source, square_grid(SEARCH_STEP_M, SEARCH_STEPS) @ least_known_motions(C))
    V = score_views(source.sight, target.sight, poses, RANKING_POINTS).astype(np.float32)
    best, best_score = None, own
    peaks = poses[_peaks(V, 2 * SEARCH_STEPS + 1)[:SEARCHED]]
    turned = _turned(source, target, T_target_source)
    for T in (*turned, *(finish(source, target, start)[0] for start in (*peaks, *turned))):
        found = score_locally(source, target, T, matched)
        if score_gain(found, own) > CLEARLY and score_gain(found, best_score) > 0.0:
            best, best_score = T, found
    return best


def _turned(source: Prepared, target: Prepared, T_target_source: Array) -> list[Array]:
    """The pose turned about the vertical through the objects, both ways; nothing where that is unknown."""
    if target.up is None or len(source.centroids) == 0:
        return []
    middle = transform(T_target_source, source.centroids.mean(axis=0))
    turns = np.radians([way * turn for turn in SEARCH_TURNS_DEG for way in (-1, 1)])
    return list(turned_about(T_target_source, middle, target.up, turns))


def _peaks(V: Array, width: int) -> list[int]:
    """The places in a square of scores, row by row, that no neighbour exceeds, best first; hopeful, not its middle."""
    square, middle = V.reshape(width, width), width // 2
    peaks = (square >= cv2.dilate(square, np.ones((3, 3), np.uint8))) & (square >= square[middle, middle] - HOPE)
    peaks[middle - 1 : middle + 2, middle - 1 : middle + 2] = False
    return [int(k) for k in np.argsort(-V, kind="stable") if peaks.ravel()[k]]


def regularising_information(source: Prepared, target: Prepared, T_target_source: Array, C: Array) -> Array:
    """The information (6, 6) that the views add to a pose of covariance ``C (6, 6)``.

    What two views of a table share may hold next to nothing across it by its shape, and everything by its print. So the
    position is perturbed where it is known least, and where the views clearly resist it is held there; then where it is
    known least after that. Nothing is added for grey that hardly correlates.
    """
    known, added = np.linalg.inv(C), np.zeros((6, 6))
    if not (source.sight.textured and target.sight.textured):
        return added
    if correlate_views(source.sight, target.sight, T_target_source) < HOLDING_CORRELATION:
        return added
    perturbed_score, left = PerturbedScore(source, target, T_target_source), np.eye(3)
    for _ in range(3):  # every direction once: the views say the same of it again
        spread = np.linalg.inv(known + added)
        values, vectors = np.linalg.eigh(left @ spread[:3, :3] @ left)
        if values[-1] <= DOUBTFUL_SIGMA_M**2:
            break
        across = vectors[:, -1]
        reach = _clear(perturbed_score, spread[:, :3] @ across / values[-1])
        if reach is None or reach > HOLDING_PERTURBATION_M:
            break
        added[:3, :3] += np.outer(across, across) / (SIGMA_SHARE * reach) ** 2
        left -= np.outer(across, across)
    return added


def _clear(perturbed_score: PerturbedScore, motion: Array) -> float | None:
    """The least perturbation in m along a motion with a clear score margin, either way, between those that are tried.

    None where there is none.
    """
    last_distance, last_margin = 0.0, 0.0
    for distance in PERTURBATIONS_M:
        margin = perturbed_score.margin(distance * motion)
        if margin >= CLEAR_MARGIN:
            between = (last_distance, distance) if last_distance > 0.0 else (distance, distance)
            return float(np.interp(CLEAR_MARGIN, (last_margin, margin), between))
        last_distance, last_margin = distance, max(0.0, margin)
    return None


def _length(direction: Array, lever: Array, extent: float) -> float:
    """How far what was seen moves, m, when its camera goes along a unit direction: its middle, and its rim about it."""
    shift, turn = direction[:3] + np.cross(direction[3:], lever), direction[3:]
    return float(np.hypot(np.linalg.norm(shift), np.linalg.norm(turn) * extent))


def _reach(perturbed_score: PerturbedScore, unit: Array) -> float | None:
    """The least perturbation in m with a clear score margin, either way; None where there is none."""
    return next(
        (distance for distance in PERTURBATIONS_M if perturbed_score.margin(distance * unit) >= CLEAR_MARGIN), None
    )
