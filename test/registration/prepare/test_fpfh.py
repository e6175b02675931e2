# SPDX-License-Identifier: Apache-2.0
"""Tests of the local features."""

from __future__ import annotations

import numpy as np

from objreg_ros.geometry import inverse, pose, rotate, rotation_from_vector, transform
from objreg_ros.native import kernels
from objreg_ros.registration.prepare.fpfh import describe, match, salient
from objreg_ros.registration.prepare.voxels import thin
from registration.rooms import keyframe, seen_from


def features(angle: float, T=np.eye(4)):
    context = keyframe(seen_from(angle), noise=0.001).context
    xyz, normals = thin(context.xyz, context.normals, 0.05)
    return describe(transform(T, xyz), rotate(T, normals), 0.2)


def test_features_do_not_change_when_the_cloud_moves() -> None:
    T = pose(rotation_from_vector(np.array([0.3, -1.2, 0.7])), np.array([0.4, 0.1, -0.3]))
    still, moved = features(0.0), features(0.0, T)
    assert len(still) == len(moved) > 500
    change = np.abs(still.histograms - moved.histograms).sum(axis=1)
    assert np.median(change) < 3.0  # of 600: a histogram's border is crossed here and there


def test_every_part_of_a_histogram_is_full() -> None:
    parts = features(0.0).histograms.reshape(-1, 3, 11).sum(axis=2)
    assert np.all((parts > 150.0) & (parts < 201.0))


def test_a_bare_wall_is_less_salient_than_the_rest() -> None:
    found = features(0.0)
    on_wall = transform(seen_from(0.0), found.xyz)[:, 0] > 3.17
    assert on_wall.sum() > 100
    assert np.median(found.saliency[~on_wall]) > np.median(found.saliency[on_wall])


def test_matches_of_two_views_are_often_true() -> None:
    a, b = features(0.0), features(15.0)
    i, j, weights = match(a, b, 300)
    truth = inverse(seen_from(15.0)) @ seen_from(0.0)
    distance = np.linalg.norm(transform(truth, a.xyz[i]) - b.xyz[j], axis=1)
    assert (distance < 0.1).mean() > 0.1
    assert len(i) <= 300 and weights.max() == 1.0


def test_the_matches_of_equal_clouds_are_their_equals() -> None:
    a = features(0.0)
    i, j, _ = match(a, a, len(a))
    change = np.abs(a.histograms[i] - a.histograms[j]).sum(axis=1)
    assert len(i) > 0.9 * len(a)
    assert (change < 2.0).all()  # of 600: a bare wall has many that are alike


def test_the_same_clouds_give_the_same_matches() -> None:
    first, second = (match(features(0.0), features(15.0), 300) for _ in range(2))
    assert all(np.array_equal(x, y) for x, y in zip(first, second, strict=True))


def test_only_the_most_salient_are_kept_where_there_are_many() -> None:
    every = features(0.0)
    kept = salient(every, 300)
    assert len(kept) == 300
    assert kept.saliency.min() >= np.sort(every.saliency)[-300]
    assert len(salient(kept, 300)) == 300 == len(salient(kept, 1000))


def test_points_without_normals_have_no_features() -> None:
    xyz = np.random.default_rng(0).random((50, 3)).astype(np.float32)
    assert len(describe(xyz, np.zeros_like(xyz), 0.2)) == 0
    empty = describe(xyz[:0], xyz[:0], 0.2)
    assert len(match(empty, empty, 10)[0]) == 0


def test_an_angle_is_known_far_finer_than_a_bin() -> None:
    true = np.linspace(-np.pi, np.pi, 721)
    found = [kernels("fpfh").angle(np.sin(angle), np.cos(angle)) for angle in true[1:-1]]
    assert np.abs(found - true[1:-1]).max() < 4e-4
