# SPDX-License-Identifier: Apache-2.0
"""Other poses of a lone object that may be the true one, for all that the views say: the gate has to know of them.

Proposers may miss the truth and agree on a pose beside it: an edge and a strip of table fit a decimetre farther on, and
the front of a screen fits its back. So others are looked for where proposers do not look: turned half, and all around.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data import Array
from objreg_ros.geometry import transform
from objreg_ros.registration.candidate import Candidate
from objreg_ros.registration.certainty.perturbation import square_grid, turned_about
from objreg_ros.registration.params import RegistrarParams
from objreg_ros.registration.prepare.prepared import Prepared
from objreg_ros.registration.propose.evidence import unoccluded_score
from objreg_ros.registration.propose.object_poses import half_turned
from objreg_ros.registration.propose.pose_voting import distinct, near
from objreg_ros.registration.refine.photometric_icp import finish
from objreg_ros.registration.score.view_score import score_views, verify

HOPELESS = 2.0  # times the violations that the gate allows: what is not refined any more
APART = (np.radians(4.0), 0.06)  # rad and m: starts are distinct beyond
BESIDE = 1.1  # tolerances of agreement off: where the search around a pose begins, rounding aside


def competing_poses(source: Prepared, target: Prepared, candidate: Candidate, params: RegistrarParams) -> list[Array]:
    """Poses (4, 4) that views score below a candidate's of one object by ``finished_margin`` at most.

    None for any other candidate. Some may be its own again once they are refined.
    """
    if len(candidate.matched) != 1:
        return []
    turned = half_turned(source, target, candidate.matched[0], candidate.T_target_source, params)
    found = [*([] if turned is None else [turned]), *_around(source, target, candidate, params)]
    return [T for T in found if _is_hopeful(source, target, T, candidate, params)]


def _around(source: Prepared, target: Prepared, candidate: Candidate, params: RegistrarParams) -> list[Array]:
    """The poses about a candidate's of the best view score, finished by grey.

    They start in a grid of upright turns about the object and shifts across the vertical, where they do not agree with
    the candidate. None without grey or gravity in both.
    """
    told = source.sight.textured and target.sight.textured and target.up is not None
    if not told or params.searched_around == 0:
        return []
    grid, middle = _grid(source, target, candidate, params), source.middle
    agreeing = np.radians(params.agreement_rotation), params.agreement_translation
    beside = ~near(grid, candidate.T_target_source, middle, *(BESIDE * tolerance for tolerance in agreeing))
    V = score_views(source.sight, target.sight, grid[beside], params, params.quick_sample)
    best = distinct(grid[beside], V, middle, params.searched_around, *APART)
    return [finish(source, target, T, params)[0] for T in grid[beside][best]]


def _grid(source: Prepared, target: Prepared, candidate: Candidate, params: RegistrarParams) -> Array:
    """The candidate's pose (K, 4, 4) turned about its object and shifted across the vertical."""
    T, up = candidate.T_target_source, np.asarray(target.up, float)
    middle = transform(T, source.centroids[candidate.matched[0].source])
    turns = np.radians([0.0, *params.turns_around, *(-turn for turn in params.turns_around)])
    turned = turned_about(T, middle, up, turns)
    shifts = square_grid(params.search_step, params.search_steps) @ np.linalg.svd(up[None])[2][1:]
    grid = np.repeat(turned[:, None], len(shifts), axis=1)
    grid[..., :3, 3] += shifts
    return grid.reshape(-1, 4, 4)


def _is_hopeful(source: Prepared, target: Prepared, T: Array, candidate: Candidate, params: RegistrarParams) -> bool:
    """Whether a pose may come near to a candidate in its score, had all that is hidden been seen to agree."""
    seen = verify(source.sight, target.sight, T, params, params.grey_points)
    behind = unoccluded_score(candidate.verification) - unoccluded_score(seen)
    return behind <= params.finished_margin and seen.violations <= HOPELESS * params.max_violations
