# SPDX-License-Identifier: Apache-2.0
"""The search of a session that does not believe odometry."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from registration.samples import box, candidate, keyframe, moved

from objreg_ros.data.closures import LoopClosure
from objreg_ros.memory.retrieval import CandidateKeyframe, Index
from objreg_ros.memory.sighting import sightings_of
from objreg_ros.memory.store import StoreError
from objreg_ros.memory.veto import Veto
from objreg_ros.registrar.candidate_search import Budget
from objreg_ros.registrar.localisation.search import (
    TRIES,
    accepted_poses,
    places_without_odometry,
    weigh_contrary,
)
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registrar.vetoes import Vetoes
from objreg_ros.registration.gate.likelihood import odds_of
from objreg_ros.registration.gate.verdict import judge

PARAMS = RegistrarParams()
CUP = box("cup", (0.0, 0.0, 1.0))
ENDLESS = Budget(np.inf, lambda: False)


def test_places_that_odometry_has_far_away_are_found_but_none_before_it_was_found_wrong() -> None:
    index = Index(PARAMS)
    stored = [replace(keyframe(k, 10.0 * k, (CUP,)), by_odometry=True) for k in (1, 2, 3, 4)]
    for one in stored:
        index.add_objects(sightings_of(one))
    far = replace(keyframe(9, 90.0, (CUP,), 0, moved(50.0)), by_odometry=True, travelled=1.0)
    assert index.query(sightings_of(far)) == []
    found = places_without_odometry(index, sightings_of(far), frozenset(), 15_000_000_000)
    assert len(found) == TRIES and {one.keyframe_id for one in found} <= {2, 3, 4}


def test_what_cannot_be_read_or_is_not_begun_in_time_is_left_out() -> None:
    def unreadable(number: int) -> Any:
        raise StoreError("damaged")

    means: Any = SimpleNamespace(store=SimpleNamespace(keyframe=unreadable))
    places = [CandidateKeyframe(1, 0, 0, 1.0)]
    assert list(accepted_poses(keyframe(), places, means, PARAMS, ENDLESS)) == []
    assert list(accepted_poses(keyframe(), places, means, PARAMS, Budget(0.0, lambda: True))) == []


def test_poses_that_the_gate_accepts_without_odometry_are_rivals_and_others_are_not() -> None:
    rivals: list[Any] = []
    here: Any = SimpleNamespace(add_rival=lambda *one: rivals.append(one))
    source, target, good = keyframe(2, 20.0), keyframe(1, 10.0), candidate(moved(1.0))
    through, doubtful = candidate(certain_violations=0.2), candidate(correlation=0.1, tested=2000)
    weigh_contrary(here, source, [(target, one) for one in (good, through, doubtful)], judge, 75.0)
    assert rivals == [(source, target, good.T_target_source, odds_of(good))]
    weigh_contrary(here, source, [(target, good)], judge, 1e9)
    assert len(rivals) == 1


def test_a_pose_of_a_pair_that_a_person_withdrew_is_none() -> None:
    source, target, good = keyframe(2, 20.0, session=1), keyframe(1, 10.0, session=1), candidate(moved(1.0))
    found = SimpleNamespace(accepted=True, candidate=good, T_target_source=good.T_target_source)
    pool = SimpleNamespace(submit=lambda *_: SimpleNamespace(result=lambda: found))
    method = SimpleNamespace(prepare=lambda _: None)
    store = SimpleNamespace(keyframe=lambda _: target)
    withdrawn = LoopClosure(
        from_ns=target.stamp_ns,
        to_ns=source.stamp_ns,
        T_from_to=good.T_target_source,
        covariance=np.eye(6),
        labels=(),
        from_session=1,
        to_session=1,
    )
    for vetoes, expected in ((Vetoes(), 1), (Vetoes([Veto(closure=withdrawn)]), 0)):
        means: Any = SimpleNamespace(store=store, method=method, pool=pool, gate=judge, vetoes=vetoes)
        poses = list(accepted_poses(source, [CandidateKeyframe(1, 0, 0, 1.0)], means, PARAMS, ENDLESS))
        assert len(poses) == expected
