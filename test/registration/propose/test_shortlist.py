# SPDX-License-Identifier: Apache-2.0
"""Tests of which hypotheses are worth finishing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.data.checked import Array
from objreg_ros.data.frames import View
from objreg_ros.geometry import inverse, pose, pose_error, rotation_from_vector
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.certainty.gravity_update import POSE_SIGMA_DEG
from objreg_ros.registration.keyframe import Context, Keyframe
from objreg_ros.registration.prepare.prepared import Pair, prepare
from objreg_ros.registration.propose.evidence import FINISHED_MARGIN
from objreg_ros.registration.propose.hypotheses import Hypothesis
from objreg_ros.registration.propose.shortlist import FINISHED, HOPELESS, TILTED, Shortlist, _hopeful, _total, shortlist
from objreg_ros.sensor import session_gravity_sigma_deg
from registration.rooms import keyframe, look_at, seen_from

PARAMS = RegistrarParams()
WALL = (("room", (-9.0, -9.0, -9.0), (2.0, 9.0, 9.0)),)
SQUARELY = look_at((0.0, 0.0, 0.0), (2.0, 0.0, 0.0))
BULGE, WIDTH, APART = 0.02, 0.25, 0.12  # m: how deep the depth of a wall is warped, how far about, and how far on later


def pair_of(source: Keyframe, target: Keyframe) -> Pair:
    return Pair(source=prepare(source, PARAMS), target=prepare(target, PARAMS))


def warped_wall(at: float, grey: bool) -> Keyframe:
    """A painted wall whose depth bulges towards the camera about ``at`` m to its right."""
    flat = keyframe(SQUARELY, WALL, noise=0.0, grey=grey)
    xyz, _ = _bulged(flat.view.xyz, at)
    points, normals = _bulged(flat.context.xyz, at)
    return replace(flat, context=Context(xyz=points, normals=normals), view=replace(flat.view, xyz=xyz))


def _bulged(xyz: Array, at: float) -> tuple[Array, Array]:
    offset = (xyz[..., :1] - at) / WIDTH
    bulge = BULGE * np.exp(-(offset**2))
    slope = 2.0 * bulge * offset / WIDTH
    normals = np.concatenate([slope, np.zeros_like(slope), -np.ones_like(slope)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return (xyz * (1.0 - bulge / xyz[..., 2:])).astype(np.float32), normals.astype(np.float32)


@pytest.mark.parametrize("grey", [True, False])
def test_what_warped_depth_draws_away_is_held_where_it_was_proposed_by_grey_alone(grey: bool) -> None:
    nudged = pose(np.eye(3), np.array([0.015, 0.0, 0.0]))
    best, hypotheses, _ = shortlist(pair_of(warped_wall(0.0, grey), warped_wall(APART, grey)), nudged)
    assert (
        max(
            pose_error(hypothesis.T_target_source, np.eye(4))[1]
            for hypothesis in hypotheses
            if hypothesis.proposer == "odometry"
        )
        > 8.0
    )
    if grey:
        assert pose_error(best[0].T_target_source, np.eye(4))[1] < 1.0
    else:
        assert pose_error(best[0].T_target_source, np.eye(4))[1] > 8.0


def test_the_best_come_first_and_are_distinct_and_few() -> None:
    pair = pair_of(keyframe(seen_from(0.0), seed=1), keyframe(seen_from(25.0), seed=2))
    best, hypotheses, of_keypoints = shortlist(pair, None)
    truth = inverse(seen_from(25.0)) @ seen_from(0.0)
    rotation, distance = pose_error(best[0].T_target_source, truth)
    assert rotation < 1.0 and distance < 2.0
    scores = [hypothesis.score.total for hypothesis in best if hypothesis.score is not None]
    assert scores == sorted(scores, reverse=True) and scores[-1] >= scores[0] - FINISHED_MARGIN
    assert len(scores) == len(best) <= FINISHED and len({hypothesis.proposer for hypothesis in hypotheses}) >= 2
    assert {hypothesis.proposer for hypothesis in of_keypoints} == {"keypoints"}


def test_what_is_held_and_keeps_gravity_about_as_well_as_the_gate_wants_it_goes_on_and_all_where_nothing_does() -> None:
    seen = keyframe(SQUARELY, WALL)
    sigma_deg = float(np.hypot(np.sqrt(2.0) * session_gravity_sigma_deg(seen.gravity_confidence), POSE_SIGMA_DEG))
    tilts = np.radians(sigma_deg) * np.array([0.0, 0.95, 1.05]) * TILTED
    turned = [pose(rotation_from_vector(np.array([0.0, 0.0, tilt])), np.zeros(3)) for tilt in tilts]
    hypotheses = [Hypothesis(T_target_source=T, proposer="features", support=0.0) for T in turned]
    for firm, hopeful in (((1, 1, 1), (0, 1)), ((0, 1, 1), (1,)), ((0, 0, 1), (0, 1, 2)), ((0, 0, 0), (0, 1, 2))):
        found = _hopeful(pair_of(seen, seen), hypotheses, np.array(firm, bool))
        assert [id(hypothesis) for hypothesis in found] == [id(hypotheses[k]) for k in hopeful]


def test_one_hypothesis_is_finished_where_none_is_hopeful(monkeypatch: pytest.MonkeyPatch) -> None:
    pair = pair_of(keyframe(seen_from(0.0)), keyframe(seen_from(30.0)))
    best, known, _ = shortlist(pair, None)
    assert _total(best[0]) > HOPELESS
    monkeypatch.setattr("objreg_ros.registration.propose.shortlist.HOPELESS", np.inf)
    (one,), fewer, _ = shortlist(pair, None)
    assert len(fewer) <= len(known) and one.score is not None


def test_nothing_is_short_listed_where_no_proposer_proposes_anything() -> None:
    bare, nothing = keyframe(SQUARELY, WALL, noise=0.0), np.zeros((0, 3), np.float32)
    dark = View(xyz=np.full_like(bare.view.xyz, np.nan), grey=None, intrinsics=bare.view.intrinsics)
    empty = replace(bare, context=Context(xyz=nothing, normals=nothing), view=dark)
    assert shortlist(pair_of(bare, empty), None) == Shortlist((), ())
