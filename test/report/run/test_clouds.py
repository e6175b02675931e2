# SPDX-License-Identifier: Apache-2.0
"""The clouds of pairs, each once, and no more than a page can carry."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import replace
from typing import Any

import numpy as np

from objreg_ros.data.images import DepthImage
from objreg_tools.report.run.clouds import LEFT_OUT, MOST_POINTS, clouds, grid_of
from objreg_tools.report.run.pairs import pairs_of
from objreg_tools.report.run.run_summary import RunSummary
from report.run.test_thumbnails import SEEN, Wall
from report.runs import STEP_NS, TRUE, TRUTH, closure, refusal, summary
from report.test_packed import unzipped

PAIRS = pairs_of(RunSummary.of("walk", summary(false=True), TRUTH))


class Every(Container[int]):
    """The stamps of a page that has all pictures."""

    def __contains__(self, stamp_ns: object) -> bool:
        return True


EVERY = Every()


class Blind(Wall):
    """A wall of which no depth was measured."""

    def at(self, stamp_ns: int) -> DepthImage:
        return replace(SEEN, depth=np.zeros_like(SEEN.depth))


def points(cloud: dict[str, Any]) -> np.ndarray:
    """As templates/space.js does."""
    depth = cloud["unit"] * np.frombuffer(unzipped(cloud["depth"]), "<u2").reshape(-1, cloud["columns"])
    v, u = np.nonzero(depth)
    fx, fy, cx, cy = cloud["camera"]
    z = depth[v, u]
    return np.stack([(u - cx) * z / fx, (v - cy) * z / fy, z], axis=1)


def test_a_cloud_is_what_the_camera_measured() -> None:
    made = clouds(PAIRS, Wall(), EVERY)
    cloud = made.moments[str(5 * STEP_NS)]
    xyz = points(cloud)
    assert xyz.shape == (48 * 64, 3) and np.allclose(xyz[:, 2], 2.0, atol=1e-4)
    assert np.allclose(xyz[0], [-1.6, -1.2, 2.0], atol=1e-4) and cloud["grid"] == [1, 64, 48]


def test_what_is_far_is_measured_too_and_what_was_not_measured_is_no_point() -> None:
    depth = np.linspace(0.0, 200.0, 48 * 64, dtype=np.float32).reshape(48, 64)
    album = Wall()
    album.at = lambda stamp_ns: replace(SEEN, depth=depth)  # type: ignore[method-assign]
    xyz = points(next(iter(clouds(PAIRS, album, EVERY).moments.values())))
    assert np.allclose(xyz[:, 2], depth.ravel()[1:], atol=0.002)


def test_a_moment_without_a_picture_on_the_page_has_no_cloud() -> None:
    made = clouds(PAIRS, Wall(), ())
    assert not made.poses and {*made.absent.values()} == {LEFT_OUT}


def test_a_pair_has_its_pose_and_a_moment_of_two_pairs_is_kept_once() -> None:
    run = {**summary(), "constraints": [closure(5, 65), closure(5, 66)]}
    made = clouds(pairs_of(RunSummary.of("walk", run, TRUTH)), Wall(), EVERY)
    assert len(made.moments) == 3 and list(made.poses) == ["c0", "c1"] and made.lacking == ""
    expected = np.linalg.inv(TRUE[5]) @ TRUE[65]
    assert np.allclose(np.reshape(made.poses["c0"], (3, 4)), expected[:3], atol=1e-5)


def test_a_refusal_has_clouds_where_it_has_a_pose() -> None:
    posed = {**refusal("texture_disagrees", 9, 99), "T_from_to": np.eye(4).tolist()}
    run = {**summary(), "refusals": [refusal("texture_disagrees", 3, 70), posed]}
    assert list(clouds(pairs_of(RunSummary.of("walk", run, TRUTH)), Wall(), EVERY).poses) == [
        "c0",
        "c1",
        "c2",
        "c3",
        "r1",
    ]


def test_a_page_that_is_full_keeps_the_false_one_and_says_what_it_leaves_out() -> None:
    whole = clouds(PAIRS, Wall(), EVERY)
    part = clouds(PAIRS, Wall(), EVERY, whole.size // 2)
    assert part.size <= whole.size // 2 and next(iter(part.poses)) == "c4"
    assert {*part.absent.values()} == {LEFT_OUT} and {*part.absent} | {*part.poses} == {*whole.poses}
    assert part.lacking == f"No clouds of {len(part.absent)} of 5: {LEFT_OUT}."
    assert clouds(PAIRS, None, EVERY).poses == {}


def test_what_has_no_cloud_says_why() -> None:
    assert clouds(PAIRS, Wall(dark_ns=10 * STEP_NS), EVERY).absent == {"c4": "it was dark"}
    assert {*clouds(PAIRS, Blind(), EVERY).absent.values()} == {"no depth was measured"}


def test_a_large_picture_is_thinned_evenly_to_the_same_places() -> None:
    camera = replace(SEEN.intrinsics, fx=400.0, fy=400.0, cx=320.0, cy=240.0, width=640, height=480)
    album = Wall()
    large = replace(SEEN, depth=np.full((480, 640), 2.0, np.float32), intrinsics=camera, rgb=None)
    album.at = lambda stamp_ns: large  # type: ignore[method-assign]
    xyz = points(next(iter(clouds(PAIRS, album, EVERY).moments.values())))
    assert 0.7 * MOST_POINTS < len(xyz) <= MOST_POINTS and grid_of((480, 640)) == 10
    assert np.allclose(xyz.min(axis=0), [-1.6, -1.2, 2.0], atol=0.05)
    assert np.allclose(xyz.max(axis=0), [1.6, 1.2, 2.0], atol=0.05)
