# SPDX-License-Identifier: Apache-2.0
"""The proposers: what each proposes, and when it has nothing to propose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objreg_ros.data.frames import UNNAMED
from objreg_ros.geometry import inverse, is_rigid, pose_error, rotate, transform
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.prepare.fpfh import Features
from objreg_ros.registration.prepare.prepared import Prepared, prepare
from objreg_ros.registration.propose import hypotheses
from objreg_ros.registration.propose.hypotheses import (
    HYPOTHESES_PER_OBJECT,
    MOST_ALIKE,
    YAW_STEPS,
    from_centroids,
    from_features,
    from_objects,
    from_prior,
    look_alikes,
    most_alike,
)
from registration.rooms import ROOM, keyframe, seen_from
from registration.samples import moved

PARAMS = RegistrarParams()
HERE, THERE = seen_from(0.0), seen_from(20.0, height=1.9)  # which looks down more steeply
TRUTH = inverse(THERE) @ HERE
LONE = tuple(box for box in ROOM if box[0] not in ("cup", "bottle", "keyboard"))
CHAINS = {"features": from_features, "centroids": from_centroids, "objects": from_objects}


@pytest.fixture(scope="module")
def room() -> tuple[Prepared, Prepared]:
    """The room with four objects from two sides."""
    return prepare(keyframe(HERE, seed=1), PARAMS), prepare(keyframe(THERE, seed=2), PARAMS)


@pytest.fixture(scope="module")
def lone() -> tuple[Prepared, Prepared]:
    """The same with the book alone."""
    return prepare(keyframe(HERE, LONE, seed=1), PARAMS), prepare(keyframe(THERE, LONE, seed=2), PARAMS)


def without(prepared: Prepared, **changes: object) -> Prepared:
    """A keyframe made ready that lacks something; without objects there are neither groups nor middles."""
    if changes.pop("objects", True) is None:
        changes |= {"groups": (), "centroids": np.zeros((0, 3))}
    return replace(prepared, **changes)


def nearest(poses: list[np.ndarray]) -> tuple[float, float]:
    """Degrees and centimetres between the truth and the pose that is nearest to it."""
    return min((pose_error(T, TRUTH) for T in poses), key=sum)


@pytest.mark.parametrize(("proposer", "degrees", "centimetres"), [("features", 3, 10), ("centroids", 4, 8)])
def test_the_true_pose_is_among_the_first_that_a_proposer_proposes(
    room: tuple[Prepared, Prepared], proposer: str, degrees: float, centimetres: float
) -> None:
    found = CHAINS[proposer](*room)
    assert {one.proposer for one in found} == {proposer}
    rotation, distance = nearest([one.T_target_source for one in found[:10]])
    assert rotation < degrees and distance < centimetres


def test_a_lone_object_proposes_a_pose_near_the_true_one(lone: tuple[Prepared, Prepared]) -> None:
    found = from_objects(*lone)
    assert len(lone[0].groups) == len(lone[1].groups) == 1
    rotation, distance = nearest([one.T_target_source for one in found[:5]])
    assert rotation < 180 / YAW_STEPS + 2 and distance < 30  # the middle of what is seen of it moves with the side


@pytest.mark.parametrize("proposer", CHAINS)
def test_every_pose_keeps_gravity(room: tuple[Prepared, Prepared], proposer: str) -> None:
    source, target = room
    found = CHAINS[proposer](source, target)
    assert source.up is not None and target.up is not None and found
    assert source.up @ target.up < np.cos(np.radians(5.0))
    for one in found:
        assert is_rigid(one.T_target_source)
        assert np.allclose(rotate(one.T_target_source, source.up), target.up, atol=1e-6)


def test_every_pose_of_an_object_lays_it_upon_one_of_its_kind(room: tuple[Prepared, Prepared]) -> None:
    source, target = room
    found, pairs = from_objects(source, target), look_alikes(source, target)
    assert len(found) == HYPOTHESES_PER_OBJECT
    for one in found:
        there = transform(one.T_target_source, source.centroids)
        assert min(np.linalg.norm(there[i] - target.centroids[j]) for i, j in pairs) < 1e-9


def test_a_lone_object_is_turned_to_every_yaw(lone: tuple[Prepared, Prepared], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hypotheses, "YAW_STEPS", 8)
    monkeypatch.setattr(hypotheses, "HYPOTHESES_PER_OBJECT", 99)
    found = from_objects(*lone)
    first = found[0].T_target_source[:3, :3]
    cosines = [np.clip(0.5 * (np.trace(first.T @ one.T_target_source[:3, :3]) - 1), -1, 1) for one in found]
    angles = np.degrees(np.arccos(cosines))
    np.testing.assert_allclose(np.sort(angles), (0, 45, 45, 90, 90, 135, 135, 180), atol=1e-4)


@pytest.mark.parametrize("proposer", CHAINS)
def test_what_is_worth_most_comes_first_and_no_more_comes_than_is_asked_for(
    room: tuple[Prepared, Prepared], proposer: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    source, target = (without(each, groups=("cup",) * len(each.groups)) for each in room)  # all look alike
    found = CHAINS[proposer](source, target)
    monkeypatch.setattr(hypotheses, "HYPOTHESES_PER_PROPOSER", 3)
    monkeypatch.setattr(hypotheses, "HYPOTHESES_PER_OBJECT", 3)
    first = CHAINS[proposer](source, target)
    supports = [one.support for one in found]
    assert supports == sorted(supports, reverse=True) and supports[0] > supports[-1]
    assert len(first) == 3
    for one, other in zip(first, found[:3], strict=True):
        assert np.array_equal(one.T_target_source, other.T_target_source) and one.support == other.support


@pytest.mark.parametrize("proposer", ["centroids", "objects"])
@pytest.mark.parametrize("lack", [{"up": None}, {"objects": None}])
@pytest.mark.parametrize("side", [0, 1])
def test_without_gravity_or_objects_on_either_side_objects_propose_nothing(
    room: tuple[Prepared, Prepared], proposer: str, lack: dict, side: int
) -> None:
    pair = list(room)
    pair[side] = without(pair[side], **lack)
    assert CHAINS[proposer](pair[0], pair[1]) == []


def test_the_middle_of_a_lone_object_gives_no_pose(lone: tuple[Prepared, Prepared]) -> None:
    assert from_centroids(*lone) == []


@pytest.mark.parametrize("side", [0, 1])
def test_without_features_on_either_side_they_propose_nothing(room: tuple[Prepared, Prepared], side: int) -> None:
    pair, none = list(room), np.zeros((0, 3), np.float32)
    bare = Features(xyz=none, normals=none, histograms=np.zeros((0, 33), np.float32), saliency=none[:, 0])
    pair[side] = without(pair[side], features=bare)
    assert from_features(pair[0], pair[1]) == []


def test_features_need_no_gravity(room: tuple[Prepared, Prepared]) -> None:
    found = from_features(without(room[0], up=None), room[1])
    rotation, distance = nearest([one.T_target_source for one in found])
    assert rotation < 12 and distance < 25


def test_objects_look_alike_where_a_detector_may_call_them_by_one_name(room: tuple[Prepared, Prepared]) -> None:
    source, target = (without(each, groups=groups) for each, groups in zip(room, ("aba", "cab"), strict=True))
    assert look_alikes(source, target) == [(0, 1), (1, 2), (2, 1)]
    assert look_alikes(source, without(target, objects=None)) == []


def test_of_objects_without_a_name_the_few_of_the_most_alike_sizes_are_tried(
    room: tuple[Prepared, Prepared], monkeypatch: pytest.MonkeyPatch
) -> None:
    source, target = (
        replace(room[side], groups=(UNNAMED, UNNAMED, "cup"), extents=np.array(extents))
        for side, extents in enumerate(((0.1, 0.5, 0.2), (0.12, 0.11, 0.9)))
    )
    assert look_alikes(source, target) == [(0, 0), (0, 1), (2, 2)]
    monkeypatch.setattr(hypotheses, "UNNAMED_PAIRS", 1)
    assert look_alikes(source, target) == [(0, 1), (2, 2)]


def test_of_many_look_alikes_few_are_laid_upon_each_other_and_every_object_upon_the_one_of_its_size(
    room: tuple[Prepared, Prepared],
) -> None:
    count = 7
    sizes = 0.1 * 1.3 ** np.arange(count)
    source = without(room[0], groups=("a",) * count, extents=sizes)
    target = without(room[1], groups=("a",) * count, extents=sizes[::-1])
    few = most_alike(source, target)
    assert len(few) == MOST_ALIKE < len(look_alikes(source, target))
    assert {(k, count - 1 - k) for k in range(count)} <= set(few)


def test_confusable_labels_are_of_one_group() -> None:
    renamed = tuple(("mouse" if box[0] == "cup" else box[0], *box[1:]) for box in ROOM)
    source, target = prepare(keyframe(HERE), PARAMS), prepare(keyframe(HERE, renamed), PARAMS)
    labels = [(source.keyframe.labels[i], target.keyframe.labels[j]) for i, j in look_alikes(source, target)]
    assert ("cup", "mouse") in labels and ("book", "book") in labels and ("cup", "book") not in labels


def test_what_odometry_expects_is_proposed_as_it_is_and_nothing_where_it_expects_nothing() -> None:
    (one,) = from_prior(moved(0.4))
    assert np.array_equal(one.T_target_source, moved(0.4)) and one.proposer == "odometry"
    assert from_prior(None) == []
