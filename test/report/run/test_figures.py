# SPDX-License-Identifier: Apache-2.0
"""Figures hold what they should, each once."""

from __future__ import annotations

import re
import tracemalloc
from xml.etree import ElementTree

import numpy as np

from objreg_tools.report.run import figures
from objreg_tools.report.run.run_summary import RunSummary
from objreg_tools.truth import Truth
from report.runs import STEP_NS, TRUE, TRUTH, closure, summary, with_a_stray

RUN = RunSummary.of("walk", summary(false=True), TRUTH)


def count(svg: str, style: str) -> int:
    return sum(style in (child.get("class") or "").split() for child in ElementTree.fromstring(svg))


def test_the_way_shows_three_lines_and_a_link_a_closure() -> None:
    svg = figures.trajectory(RUN, RUN.tracks().stamps_ns, RUN.tracks().lines)
    assert [count(svg, style) for style in ("true", "odometry", "corrected", "link", "false")] == [1, 1, 1, 5, 1]
    assert "off by 0.0° and 50.0 cm" in svg


def test_the_closures_of_a_run_without_odometry_are_drawn_on_the_true_way() -> None:
    blind = RunSummary.of("blind", {**summary(), "glimpses": []}, TRUTH)
    stamps_ns, true = blind.true_trajectory()
    svg = figures.trajectory(blind, stamps_ns, {"true": true})
    assert [count(svg, style) for style in ("true", "odometry", "link")] == [1, 0, 4]


def test_a_drawing_for_a_telephone_has_letters_of_the_same_size_in_less_width() -> None:
    wide, narrow = (figures.timeline(RUN, width) for width in (figures.WIDE, figures.NARROW))
    assert 'viewBox="0 0 1040 ' in wide and 'viewBox="0 0 400 ' in narrow
    assert max(float(x) for x in re.findall(r' cx="([^"]+)"', narrow)) <= 400


def test_a_closure_states_what_had_moved() -> None:
    of_move = {**closure(0, 60), "evidence": {"score": 0.8, "moved soda_can [m]": 0.412}}
    run = RunSummary.of("walk", {**summary(), "constraints": [of_move]}, TRUTH)
    assert figures.closure_text(run, run.closures[0]).endswith(
        "cup, book, soda can moved by 0.41 m, off by 0.0° and 0.0 cm"
    )


def test_the_error_has_two_lines_with_truth() -> None:
    svg = figures.error_over_time(RUN, RUN.tracks())
    assert count(svg, "odometry") == count(svg, "corrected") == 1


def test_the_timeline_has_a_dot_a_refusal_and_a_row_a_reason() -> None:
    svg = figures.timeline(RUN)
    assert count(svg, "refused") == 3
    assert "texture disagrees" in svg and "no candidate" in svg
    assert count(svg, "seen") > 3  # the cups and the book come and go


def test_the_timeline_and_the_error_are_of_the_run_without_what_is_of_another_time() -> None:
    stray_ns = -1_700_000_000 * 10**9
    known = Truth([(stray_ns, TRUE[0]), *((k * STEP_NS, T) for k, T in enumerate(TRUE))])
    run = RunSummary.of("walk", with_a_stray(stray_ns), known)
    svg = figures.timeline(run)
    assert count(svg, "refused") == 3 and "ghost," not in svg
    bars = [child for child in ElementTree.fromstring(svg) if "seen" in (child.get("class") or "").split()]
    assert max(float(bar.get("width", 0)) for bar in bars) > 20
    assert stray_ns in run.tracks().stamps_ns
    (line, _) = re.findall(r'points="([^"]+)"', figures.error_over_time(run, run.tracks()))
    assert len({point.split(",")[0] for point in line.split()}) == len(TRUE)


def test_the_map_names_every_object_once() -> None:
    svg = figures.object_map(RUN, corrected=True)
    names = [node.text for node in ElementTree.fromstring(svg) if node.get("class") == "name"]
    assert sorted(names) == ["book", "cup", "cup"]


def test_heaps_of_one_label_are_kept_apart_and_strays_have_no_name() -> None:
    xy = np.array([[0.0, 0.0]] * 5 + [[3.0, 0.0]] * 5 + [[9.0, 9.0]])
    assert [tuple(place) for _, place in figures.clusters(["cup"] * 11, xy)] == [(0.0, 0.0), (3.0, 0.0)]


def test_heaps_of_a_long_run_need_no_more_memory_than_its_sightings() -> None:
    xy = np.random.default_rng(0).normal(0.0, 0.05, (5000, 2))
    tracemalloc.start()
    (heap,) = figures.clusters(["cup"] * len(xy), xy)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert heap[0] == "cup" and np.abs(heap[1]).max() < 0.01
    assert most < 100 * xy.nbytes


def test_names_that_would_cover_each_other_are_moved_apart() -> None:
    placed = dict(figures.apart([("cup", (100.0, 50.0)), ("book", (105.0, 52.0)), ("tv", (300.0, 50.0))]))
    assert placed["book"] == (105.0, 52.0) and placed["tv"] == (300.0, 50.0)
    assert placed["cup"][0] == 100.0 and placed["cup"][1] <= 52.0 - figures.LINE


def test_the_ground_is_the_plane_of_the_way() -> None:
    angles = np.linspace(0, 2 * np.pi, 50)
    xyz = np.column_stack([2 * np.cos(angles), np.full(50, 0.7), np.sin(angles)])
    np.testing.assert_allclose(np.ptp(figures.GroundAxes(xyz).flat(xyz), axis=0), [4.0, 2.0], atol=0.02)


def test_the_ground_of_a_long_way_needs_no_more_memory_than_the_way() -> None:
    xyz = np.random.default_rng(0).normal(size=(5000, 3))
    tracemalloc.start()
    ground = figures.GroundAxes(xyz)
    assert tracemalloc.get_traced_memory()[1] < 5e6
    tracemalloc.stop()
    assert ground.flat(xyz).shape == (5000, 2) and figures.GroundAxes(xyz[:1]).axes.shape == (2, 3)
