# SPDX-License-Identifier: Apache-2.0
"""The last step of a registration: 6 DoF on all that was seen, its score, and which directions it leaves degenerate.

Our own refinement, because a GICP of small_gicp after it (3 cm voxels, 13 ms) makes the views agree less: over 63 pairs
of real keyframes the median V falls from 0.75 to 0.59 and the share within 5 degrees and 10 cm from 0.95 to 0.92; kept
only where V does not fall, it changes one pair.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.data.closures import Alignment
from objreg_ros.geometry import transform
from objreg_ros.registration.certainty.degeneracy import about_camera, degenerate_directions
from objreg_ros.registration.certainty.observability import split_directions
from objreg_ros.registration.certainty.sandwich import information
from objreg_ros.registration.prepare.prepared import Prepared
from objreg_ros.registration.refine.batch_icp import LEAST_PAIRS, REACHES_M, fit
from objreg_ros.registration.refine.photometric_icp import finish
from objreg_ros.registration.score.comparison import score_gain, score_locally
from objreg_ros.registration.score.object_matches import match_objects

PHOTOMETRIC_ROUNDS = 3  # most times that grey finishes a pose, coarse to fine
DEGENERATE_SHARE = 0.01  # a direction that a smaller share of the surface resists is degenerate
HOLDING_CORRELATION = 0.45  # of grey from which on it resolves a degenerate direction
LITTLE = 0.02  # gain in score after which another round costs more than it gains


def refine(source: Prepared, target: Prepared, T_target_source: Array) -> Alignment:
    """Finish a settled pose; ``converged`` is False where next to nothing holds it.

    Grey has its say, and keeps it where views and objects score the pose no lower. The information is that of patches
    of surface, because neighbouring points err together.
    """
    T, grey = _finished(source, target, T_target_source)
    found = fit(source.xyz, source.normals, target.surface, T, REACHES_M[-1])
    degenerate = degenerate_directions(
        found._replace(H=found.H + grey), T, transform(T, source.middle), DEGENERATE_SHARE
    )
    noises = source.sight.noise, target.sight.noise
    free, regularised = split_directions(source, target, T, degenerate, found.extent)
    return Alignment(
        T_target_source=T,
        information=about_camera(information(source.xyz, source.normals, target.surface, T, noises), T),
        inliers=found.inliers,
        overlap=found.inliers / max(1, len(source.xyz)),
        rmse=found.rmse,
        converged=found.inliers >= LEAST_PAIRS,
        degenerate=free,
        regularised=regularised,
        middle=transform(T, source.middle),
    )


def _finished(source: Prepared, target: Prepared, T: Array) -> tuple[Array, Array]:
    """The pose after grey had its say, and what grey adds to its information: nothing where it does not correlate.

    Again while views and objects score it clearly higher (`comparison`), since each round sees more of the other view;
    the pose as it was, where they score it lower: views that share little may score a pose a hair higher that is
    centimetres off, and the objects then look less alike.
    """
    grey_information = np.zeros((6, 6))
    if not (source.sight.textured and target.sight.textured):
        return T, grey_information
    matched, _ = match_objects(source, target, T)
    best = score_locally(source, target, T, matched)
    for _ in range(PHOTOMETRIC_ROUNDS):
        finished, grey = finish(source, target, T)
        found = score_locally(source, target, finished, matched)
        gained = score_gain(found, best)
        if gained < 0.0:
            break
        best, T = found, finished
        grey_information = grey if (found.seen.correlation or 0.0) >= HOLDING_CORRELATION else np.zeros((6, 6))
        if gained < LITTLE:
            break
    return T, grey_information
