# SPDX-License-Identifier: Apache-2.0
"""Corners are followed through pictures that move by what is known."""

from __future__ import annotations

import numpy as np
import pytest

from objreg_ros.data.checked import Array
from objreg_ros.plausibility.camera_fit import CORNER_SIGMA_PX
from objreg_ros.plausibility.corner_tracks import LEAST_CORNERS, SPAN_S, SPAN_SHARE, CornerTracks, Span, depth_at
from plausibility.box_room import seen_as, speckles
from plausibility.moving import CAMERA

WALL = speckles(400)
FLAT = np.full((CAMERA.height, CAMERA.width), 2.0, np.float32)
STEP_NS = 10**8


def picture(right: int, down: int = 0) -> Array:
    """A wall whose spots lie so many pixels farther to the right and down."""
    top, left = 100 - down, 120 - right
    return np.ascontiguousarray(WALL[top : top + CAMERA.height, left : left + CAMERA.width])


def follow(greys: list[Array | None], depth: Array = FLAT, step_ns: int = STEP_NS) -> list[Span]:
    tracks = CornerTracks()
    ended = [tracks.track_view(k * step_ns, seen_as(depth, grey)) for k, grey in enumerate(greys)]
    return [span for span in ended if span is not None]


@pytest.mark.parametrize(("right", "down"), [(6, 0), (-6, 0), (4, -5)])
def test_corners_move_by_as_much_as_the_picture_does(right: int, down: int) -> None:
    (span,) = follow([picture(k * right, k * down) for k in range(5)])
    moved = span.uv_last - span.uv_first
    expected = np.array([right, down]) * ((span.last_ns - span.first_ns) // STEP_NS)
    np.testing.assert_allclose(np.median(moved, axis=0), expected, atol=0.01)
    assert np.abs(moved - expected).max() < CORNER_SIGMA_PX, "also at the rim, where a part of their look is gone"
    assert len(moved) >= LEAST_CORNERS and (span.z_first == 2.0).all() and (span.z_last == 2.0).all()


def test_a_span_ends_once_its_corners_have_moved_far_enough() -> None:
    (span,) = follow([picture(6 * k) for k in range(5)])
    moved = 6 * (span.last_ns - span.first_ns) // STEP_NS
    assert moved - 6 <= SPAN_SHARE * CAMERA.width < moved


def test_a_span_ends_after_its_longest_time_however_little_it_moved() -> None:
    (span,) = follow([picture(k) for k in range(12)], step_ns=110_000_000)
    assert span.first_ns == 0 and span.last_ns == 7 * 110_000_000
    assert 6 * 0.11 < SPAN_S < 7 * 0.11
    np.testing.assert_allclose(np.median(span.uv_last - span.uv_first, axis=0), [7, 0], atol=0.01)


def test_a_camera_at_rest_has_no_span() -> None:
    assert follow([picture(0)] * 20) == []


def test_a_view_without_grey_is_passed_over() -> None:
    greys = [picture(6 * k) for k in range(5)]
    (with_gap,) = follow([greys[0], None, *greys[2:]])
    (whole,) = follow(list(greys))
    assert with_gap.last_ns == whole.last_ns
    np.testing.assert_allclose(np.median(with_gap.uv_last - with_gap.uv_first, axis=0), [24, 0], atol=0.1)
    assert follow([None] * 10) == []


def test_a_picture_without_corners_has_no_span() -> None:
    assert follow([np.full_like(picture(0), 128)] * 10) == []


def test_corners_without_depth_make_no_span() -> None:
    assert follow([picture(6 * k) for k in range(5)], np.full_like(FLAT, np.nan)) == []


def test_a_picture_of_another_scene_ends_the_span_without_a_false_match() -> None:
    other = np.ascontiguousarray(speckles(400, seed=9)[: CAMERA.height, : CAMERA.width])
    assert follow([picture(0), other, other]) == []


def test_another_size_of_picture_and_a_stamp_that_goes_back_begin_anew() -> None:
    tracks = CornerTracks()
    for k in range(3):
        assert tracks.track_view((10 + k) * STEP_NS, seen_as(FLAT, picture(6 * k))) is None
    spans = [tracks.track_view(k * STEP_NS, seen_as(FLAT, picture(6 * k))) for k in range(5)]
    assert [span is not None for span in spans] == [False] * 4 + [True]
    assert spans[4] is not None and spans[4].first_ns == 0
    half = CAMERA.scaled(2)
    assert (
        tracks.track_view(6 * STEP_NS, seen_as(FLAT[::2, ::2], np.ascontiguousarray(picture(0)[::2, ::2]), half))
        is None
    )


PLANE = (2.0 + 0.004 * np.arange(40) - 0.003 * np.arange(30)[:, None]).astype(np.float64)


def test_depth_between_pixels_is_exact_on_a_plane() -> None:
    uv = np.array([[10.0, 10.0], [10.4, 9.7], [25.25, 20.5], [3.49, 27.51]])
    np.testing.assert_allclose(depth_at(PLANE, uv), 2.0 + 0.004 * uv[:, 0] - 0.003 * uv[:, 1], atol=1e-12)


def test_depth_at_an_edge_is_unknown() -> None:
    step = np.full((30, 40), 1.0)
    step[:, 20:] = 1.5
    at = depth_at(step, np.array([[18.0, 10.0], [19.0, 10.0], [20.0, 10.0], [21.0, 10.0]]))
    np.testing.assert_array_equal(at, [1.0, np.nan, np.nan, 1.5])


def test_depth_beside_what_is_unknown_is_unknown() -> None:
    holed = PLANE.copy()
    holed[10, 10] = np.nan
    at = depth_at(holed, np.array([[10.0, 10.0], [11.0, 11.0], [9.0, 10.0], [12.0, 10.0]]))
    assert np.isfinite(at).tolist() == [False, False, False, True]


def test_depth_of_no_pixels_and_in_a_picture_too_small_for_a_plane() -> None:
    assert depth_at(PLANE, np.zeros((0, 2))).shape == (0,)
    assert np.isnan(depth_at(PLANE[:2], np.array([[1.0, 1.0]]))).all()
