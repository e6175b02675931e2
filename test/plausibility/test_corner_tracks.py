# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np

from objreg_ros.geometry import pose
from objreg_ros.plausibility.corner_tracks import CornerTracks, Span, depth_at
from plausibility.spans import CAMERA
from plausibility.views import view

STEP_NS = 100_000_000


def spans_of(shifts_m: list[float]) -> list[Span]:
    """What ends as the camera is at these places across."""
    tracks, ended = CornerTracks(), []
    for k, across in enumerate(shifts_m):
        span = tracks.add(k * STEP_NS, view(pose(np.eye(3), np.array([across, 0.0, 0.0]))))
        ended += [] if span is None else [span]
    return ended


def test_corners_move_as_the_camera_makes_them() -> None:
    ended = spans_of([0.04 * k for k in range(20)])
    assert len(ended) >= 2
    for span in ended:
        moved = 1e-9 * (span.last_ns - span.first_ns) * 0.4
        expected = span.uv_first - np.column_stack([CAMERA.fx * moved / span.z_first, np.zeros(len(span.z_first))])
        assert np.median(np.abs(span.uv_last - expected)) < 0.2
        assert np.median(np.abs(span.z_last - span.z_first)) < 0.02


def test_a_camera_at_rest_ends_no_span() -> None:
    assert spans_of([0.0] * 30) == []


def test_a_view_without_a_picture_is_passed_over() -> None:
    tracks = CornerTracks()
    assert all(tracks.add(k * STEP_NS, replace(view(np.eye(4)), grey=None)) is None for k in range(10))


def test_the_depth_between_pixels_is_that_of_the_plane_through_them() -> None:
    columns, rows = np.meshgrid(np.arange(20.0), np.arange(10.0))
    plane = 2.0 + 0.01 * columns - 0.02 * rows
    np.testing.assert_allclose(depth_at(plane, np.array([[7.3, 4.6]])), [2.0 + 0.073 - 0.092], atol=1e-12)


def test_at_an_edge_and_beside_what_is_unknown_there_is_no_depth() -> None:
    step = np.full((10, 20), 1.0)
    step[:, 10:] = 2.0
    step[2, 3] = np.nan
    assert np.isnan(depth_at(step, np.array([[9.6, 5.0], [3.4, 2.8]]))).all()
    assert (
        np.isnan(depth_at(np.ones((2, 2)), np.array([[0.0, 0.0]]))).all() and len(depth_at(step, np.zeros((0, 2)))) == 0
    )
