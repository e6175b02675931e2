# SPDX-License-Identifier: Apache-2.0
"""Other poses of a lone object that may be the true one, for all that the views say: the gate has to know of them.

Proposers may miss the truth and agree on a pose beside it: an edge and a strip of table fit a decimetre farther on, and
the front of a screen fits its back. So others are looked for where proposers do not look: turned half, and all around.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import transform
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.certainty.observability import SEARCH_STEP_M, SEARCH_STEPS
from objreg_ros.registration.certainty.perturbation import square_grid, turned_about
from objreg_ros.registration.kernels.same_pose import AGREEING, STARTS, Nearness, distinct, near
from objreg_ros.registration.prepare.prepared import Prepared
from objreg_ros.registration.propose.evidence import FINISHED_MARGIN, unoccluded_score
from objreg_ros.registration.propose.object_poses import half_turned
from objreg_ros.registration.refine.photometric_icp import finish
from objreg_ros.registration.score.view_score import PHOTOMETRIC_POINTS, RANKING_POINTS, score_views, verify

TURNS_DEG = (5.0, 10.0, 15.0)  # about a lone object, each way, of the grid of competing poses
REFINED = 4  # best starts about a lone object's pose
HOPELESS = 0.14  # share of violations from which on a pose is not refined any more
BESIDE = 1.1  # tolerances of agreement off: where the search around a pose begins, rounding aside


def competing_poses(source: Prepared, target: Prepared, candidate: Candidate) -> list[Array]:
    """Poses (4, 4) that views score below a candidate's of one object by `FINISHED_MARGIN` at most.

    None for any other candidate. Some may be its own again once they are refined.
    """
    if len(candidate.matched) != 1:
        return []
    turned = half_turned(source, target, candidate.matched[0], candidate.T_target_source)
    found = [*([] if turned is None else [turned]), *_around(source, target, candidate)]
    return [T for T in found if _is_hopeful(source, target, T, candidate)]


def _around(source: Prepared, target: Prepared, candidate: Candidate) -> list[Array]:
    """The poses about a candidate's of the best view score, finished by grey.

    They start in a grid of upright turns about the object and shifts across the vertical, where they do not agree with
    the candidate. None without grey or gravity in both.
    """
    known = source.sight.textured and target.sight.textured and target.up is not None
    if not known or REFINED == 0:
        return []
    grid, middle = _grid(source, target, candidate), source.middle
    beside = ~near(
        grid, candidate.T_target_source, middle, Nearness(BESIDE * AGREEING.angle, BESIDE * AGREEING.distance)
    )
    V = score_views(source.sight, target.sight, grid[beside], RANKING_POINTS)
    best = distinct(grid[beside], V, middle, REFINED, STARTS)
    return [finish(source, target, T)[0] for T in grid[beside][best]]


def _grid(source: Prepared, target: Prepared, candidate: Candidate) -> Array:
    """The candidate's pose (K, 4, 4) turned about its object and shifted across the vertical."""
    T, up = candidate.T_target_source, np.asarray(target.up, float)
    middle = transform(T, source.centroids[candidate.matched[0].source])
    turns = np.radians([0.0, *TURNS_DEG, *(-turn for turn in TURNS_DEG)])
    turned = turned_about(T, middle, up, turns)
    shifts = square_grid(SEARCH_STEP_M, SEARCH_STEPS) @ np.linalg.svd(up[None])[2][1:]
    grid = np.repeat(turned[:, None], len(shifts), axis=1)
    grid[..., :3, 3] += shifts
    return grid.reshape(-1, 4, 4)


def _is_hopeful(source: Prepared, target: Prepared, T: Array, candidate: Candidate) -> bool:
    """Whether a pose may come near to a candidate in its score, had all that is hidden been seen to agree."""
    seen = verify(source.sight, target.sight, T, PHOTOMETRIC_POINTS)
    behind = unoccluded_score(candidate.verification) - unoccluded_score(seen)
    return behind <= FINISHED_MARGIN and seen.violations <= HOPELESS
