# SPDX-License-Identifier: Apache-2.0
"""The last step of a registration: 6 DoF on all that was seen, what that is worth, and where it may still slide.

Our own refinement, because a GICP of small_gicp after it (3 cm voxels, 13 ms) makes the views agree less: over 63 pairs
of real keyframes the median V falls from 0.75 to 0.59 and the share within 5 degrees and 10 cm from 0.95 to 0.92; kept
only where V does not fall, it changes one pair.
"""

from __future__ import annotations

import numpy as np

from objreg_ros.data import Alignment, Array
from objreg_ros.geometry import transform
from objreg_ros.registration.certainty.degeneracy import about_camera, slack
from objreg_ros.registration.certainty.observability import resisted
from objreg_ros.registration.certainty.sandwich import information
from objreg_ros.registration.params import RegistrarParams
from objreg_ros.registration.prepare.prepared import Prepared
from objreg_ros.registration.refine.batch_icp import fit
from objreg_ros.registration.refine.photometric_icp import finish
from objreg_ros.registration.score.comparison import gain, liked
from objreg_ros.registration.score.object_matches import explain

LITTLE = 0.02  # gain after which another round is not worth its time


def refine(source: Prepared, target: Prepared, T_target_source: Array, params: RegistrarParams) -> Alignment:
    """Finish a settled pose; ``converged`` is False where next to nothing holds it.

    Grey has its say, and keeps it where views and objects like the pose no less. The information is that of patches of
    surface, because neighbouring points err together.
    """
    T, grey = _finished(source, target, T_target_source, params)
    found = fit(source.xyz, source.normals, target.surface, T, params.reaches[-1])
    loose = slack(found._replace(H=found.H + grey), T, transform(T, source.middle), params.slack_share)
    free, held = resisted(source, target, T, loose, found.extent, params)
    return Alignment(
        T_target_source=T,
        information=about_camera(information(source.xyz, source.normals, target.surface, T, params), T),
        inliers=found.inliers,
        overlap=found.inliers / max(1, len(source.xyz)),
        rmse=found.rmse,
        converged=found.inliers >= params.min_points,
        slack=free,
        held=held,
        middle=transform(T, source.middle),
    )


def _finished(source: Prepared, target: Prepared, T: Array, params: RegistrarParams) -> tuple[Array, Array]:
    """The pose after grey had its say, and what grey adds to its information: nothing where it does not correlate.

    Again while views and objects like it clearly better (`comparison`), since each round sees more of the other view;
    the pose as it was, where they like it less: views that share little may like a pose a hair better that is
    centimetres off, and the objects then look less alike.
    """
    held = np.zeros((6, 6))
    if not (source.sight.textured and target.sight.textured):
        return T, held
    explained, _ = explain(source, target, T, params)
    best = liked(source, target, T, explained, params)
    for _ in range(params.grey_rounds):
        finished, grey = finish(source, target, T, params)
        found = liked(source, target, finished, explained, params)
        gained = gain(found, best, params)
        if gained < 0.0:
            break
        best, T = found, finished
        held = grey if (found.seen.texture or 0.0) >= params.holding_texture else np.zeros((6, 6))
        if gained < LITTLE:
            break
    return T, held
