# SPDX-License-Identifier: Apache-2.0
"""Candidates of a lone object, and their competing hypotheses."""

from __future__ import annotations

from objreg_ros.registration.candidate import Candidate, ObjectPair
from registration.samples import candidate

CUP = ObjectPair(0, 0, "cup")


def lone(**evidence: object) -> Candidate:
    """A candidate of one object that no second proposer confirms, in a plain room."""
    alone = {"matched": (ObjectPair(0, 0, "cup"),), "agreeing_proposers": ("objects",), "correlation": 0.4}
    return candidate(**{**alone, "silhouette_score": 0.6, "yaw_known": True, "score_margin": 0.4, **evidence})


def competitor(one: Candidate, behind: float, **evidence: object) -> Candidate:
    """Another pose of the same object, worth so much less."""
    return lone(score=one.verification.score - behind, silhouette_score=one.silhouette_score, **evidence)
