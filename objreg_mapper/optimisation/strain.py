# SPDX-License-Identifier: Apache-2.0
"""How far closures are from what odometry says between their keyframes, by the deviations of both.

Closures that agree with each other, and with no other one beside them, bend a map whatever they say: odometry alone
can contradict them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from objreg_mapper.constraint import inverted, local_covariance, rotation_vectors
from objreg_mapper.optimisation.chain import Chain
from objreg_mapper.session import stacked
from objreg_ros.data.checked import Array
from objreg_ros.geometry import inverses

if TYPE_CHECKING:
    from objreg_mapper.optimisation.problem import Tie

LIMIT = 4.1  # standard deviations: what one in a hundred that agree exceeds, the root of chi-squared of six freedoms
LEAST_COUNT, LEAST_SHARE = 2, 0.05  # of the closures that are beyond it, where not chance has put them there
MOST = 10_000  # closures that are judged, the newest


class Strain(NamedTuple):
    """How many closures were judged, how many are beyond `LIMIT`, and the farthest in m, degrees and deviations."""

    judged: int = 0
    beyond: int = 0
    metres: float = 0.0
    degrees: float = 0.0
    sigmas: float = 0.0

    @property
    def farthest(self) -> str:
        """How far the farthest is, as text."""
        return f"{self.metres:.3f} m, {self.degrees:.2f} deg, {self.sigmas:.1f} deviations"

    @property
    def is_suspicious(self) -> bool:
        """Whether more are beyond than chance puts there: closures are false, or odometry is worse than it says."""
        return self.beyond >= LEAST_COUNT and self.beyond > LEAST_SHARE * self.judged


def strain_of(ties: Sequence[Tie], chains: Mapping[int, Chain], picture_sigmas: tuple[float, float]) -> Strain:
    """The strain of closures within one session each; ``chains`` are the sessions', as far as they are known."""
    within = [tie for tie in ties[-MOST:] if tie.end1.session == tie.end2.session and tie.end1.session in chains]
    parts = [
        misfits([tie for tie in within if tie.end1.session == session], chain, picture_sigmas)
        for session, chain in chains.items()
    ]
    metres, degrees, sigmas = (np.concatenate([part[k] for part in parts]) if parts else np.zeros(0) for k in range(3))
    if not len(sigmas):
        return Strain()
    worst = int(sigmas.argmax())
    beyond = int((sigmas > LIMIT).sum())
    return Strain(len(sigmas), beyond, float(metres[worst]), float(degrees[worst]), float(sigmas[worst]))


def misfits(ties: Sequence[Tie], chain: Chain, picture_sigmas: tuple[float, float]) -> tuple[Array, Array, Array]:
    """How far each of the closures of one session is from odometry: (m,) in m, degrees and standard deviations."""
    ordered = [tie if tie.end1.keyframe <= tie.end2.keyframe else _reversed(tie) for tie in ties]
    if not ordered:
        return np.zeros(0), np.zeros(0), np.zeros(0)
    k1, k2 = (np.array([end.keyframe for end in ends]) for ends in zip(*(tie[:2] for tie in ordered), strict=True))
    odometry, spread = chain.motions(k1, k2)
    closures = stacked([tie.constraint.T_from_to for tie in ordered])
    spread = spread + np.array([local_covariance(tie.constraint) for tie in ordered])
    spread = spread + 2.0 * np.diag(np.repeat(np.square(picture_sigmas), 3))
    apart = inverses(closures) @ odometry
    error = np.hstack([apart[:, :3, 3], rotation_vectors(apart[:, :3, :3])])
    squared = np.einsum("mi,mi->m", error, np.linalg.solve(spread, error[:, :, None])[:, :, 0])
    turned = np.degrees(np.linalg.norm(error[:, 3:], axis=1))
    return np.linalg.norm(error[:, :3], axis=1), turned, np.sqrt(np.maximum(squared, 0.0))


def _reversed(tie: Tie) -> Tie:
    return tie._replace(end1=tie.end2, end2=tie.end1, constraint=inverted(tie.constraint))
