# SPDX-License-Identifier: Apache-2.0
"""A run as things in space."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_tools.report.exports.run_scene import MOST_POINTS, WIDTH, scene_of
from objreg_tools.report.run.run_summary import RunSummary
from objreg_tools.truth import Truth
from report.runs import COUNT, STEP_NS, TRUE, TRUTH, summary
from report.scenes import SEEN, FewPictures, walk


def test_three_ways_are_in_one_frame() -> None:
    ways = walk(false=False).trajectories
    assert list(ways) == ["odometry", "corrected", "true"] and all(len(way.stamps_ns) == COUNT for way in ways.values())
    assert np.allclose(ways["odometry"].poses[0], np.eye(4))
    pytest.importorskip("gtsam")
    off = np.linalg.norm(ways["corrected"].positions - ways["true"].positions, axis=1)
    drifted = np.linalg.norm(ways["odometry"].positions - ways["true"].positions, axis=1)
    assert off.max() < drifted.max()


def test_closures_have_their_places_and_their_true_error() -> None:
    scene = walk()
    verdicts = [edge.verdict for edge in scene.edges]
    assert verdicts.count("false") == 1 and len(verdicts) == 5
    assert scene.edges[0].text == "cup, book: off by 0.0°, 0.0 cm"
    assert np.array_equal(scene.edges[0].ends[0], scene.trajectories["corrected"].positions[5])


def test_moments_are_thinned_and_those_without_a_picture_are_passed_over() -> None:
    moments = list(walk().moments())
    assert [moment.stamp_ns // STEP_NS for moment in moments] == list(SEEN)
    moment = moments[1]
    assert moment.rgb.shape == (240, WIDTH, 3) and moment.camera.width == WIDTH
    assert 0 < len(moment.xyz) == len(moment.colours) <= 1.1 * MOST_POINTS
    assert np.allclose(moment.xyz[:, 2], 2.0) and (moment.colours == (200, 10, 20)).all()
    assert np.array_equal(moment.T_map_camera, walk().main.poses[30])


def test_without_odometry_the_truth_is_shown() -> None:
    run = summary()
    run["glimpses"] = [{"stamp_ns": row["stamp_ns"]} for row in run["glimpses"]]
    scene = scene_of(RunSummary.of("walk", run, TRUTH), FewPictures())  # type: ignore[arg-type]
    assert list(scene.trajectories) == ["true"] and scene.objects == () and len(scene.edges) == 4
    assert np.allclose(scene.main.poses[7], TRUE[7])


def test_a_run_of_which_nobody_knows_where_it_was_is_refused() -> None:
    run = {"glimpses": [{"stamp_ns": 5}], "constraints": []}
    with pytest.raises(ValueError, match="walk: expected odometry or a ground truth"):
        scene_of(RunSummary.of("walk", run, Truth([])), FewPictures())  # type: ignore[arg-type]
