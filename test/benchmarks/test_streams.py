# SPDX-License-Identifier: Apache-2.0
"""Which cases of recordings that are wrong about themselves are run, and how they are counted."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
from click.testing import CliRunner

from objreg_ros.data.images import ColourImage, Detections
from objreg_ros.geometry import inverse, pose, rotation_from_vector
from objreg_tools.truth import Truth

GENERATOR = '''"""Bags that are odd. CASE chooses:

plain       as it should be,
            and more of it
body_cloud_tf a name as long as its column
far_8191     a number in it
"""
'''


def ground(name: str, is_level: bool = False) -> Any:
    from stream_grounds import Ground

    return Ground(name, Path(name), "model.onnx", 0.5, is_level)


def row(kind: str, constraints: int, false: int = 0, findings: tuple[str, ...] = (), reference: bool = False) -> Any:
    return {
        "kind": kind,
        "ground": "room",
        "odometry": True,
        "is_reference": reference,
        "constraints": constraints,
        "false": false,
        "findings": list(findings),
        "seconds": 2.0,
        "mount_error": None,
    }


def test_cases_are_spread_evenly_over_kinds_and_grounds_each_with_its_seed() -> None:
    from streams import cases

    made = cases(("focal", "mount_wrong"), [ground("a"), ground("b")], 8, 80, 5)
    assert set(Counter((case.kind, case.ground.name) for case in made).values()) == {2}
    assert [case.seed for case in made] == list(range(5, 13))
    assert all(case.other.name != case.ground.name for case in made)
    assert all(case.odometry for case in made if case.kind == "mount_wrong")


def test_every_ground_is_run_right_once_with_and_without_odometry_where_a_case_is() -> None:
    from stream_cases import references
    from streams import cases

    made = cases(("focal", "mount_wrong"), [ground("a"), ground("b")], 60, 80)
    right = references(made)
    assert all(case.kind == "right" and case.is_reference for case in right)
    assert {(case.ground.name, case.odometry) for case in right} == {(g, o) for g in "ab" for o in (True, False)}


def test_closures_are_lost_below_four_fifths_of_the_right_ones_and_where_one_is_false() -> None:
    from stream_cases import judged

    rows = [row("right", 10, reference=True), row("focal", 8), row("focal", 7), row("focal", 12, 1)]
    assert [r["loses"] for r in judged(rows)] == [False, False, True, True]
    assert {r["right"] for r in judged(rows)} == {10}


def test_only_losses_must_be_named_and_by_their_own_cause() -> None:
    from stream_cases import judged
    from stream_table import table, totals

    named, other = ("camera-focal-length",), ("depth-scale",)
    rows = [
        row("right", 10, reference=True),
        row("right", 10, findings=other),
        row("focal", 10),
        row("focal", 2, 1, named),
        row("focal", 3, findings=other),
    ]
    total = totals(judged(rows))
    assert (total["cases"], total["false"], total["losing"], total["named"]) == (3, 1, 2, 1)
    assert (total["named_share"], total["right_cases"], total["right_with_cause"]) == (0.5, 2, 1)
    assert "focal                    3          15       30     1      2     1  depth-scale" in table(judged(rows))


def test_the_error_of_a_mount_is_given_where_one_was_estimated() -> None:
    from stream_cases import mount_error

    true = pose(rotation_from_vector(np.array([0.0, 0.0, 0.5])), np.array([0.1, 0.0, 0.0]))
    estimate = {"T_body_camera": (true @ pose(rotation_from_vector(np.radians([3.0, 0, 0])), np.zeros(3))).tolist()}
    assert mount_error(estimate, true) == pytest.approx((3.0, 0.0))
    assert mount_error(None, true) is None and mount_error({}, true) is None and mount_error(estimate, None) is None


def test_a_picture_that_was_seen_before_is_not_detected_in_again_and_keeps_its_own_time() -> None:
    from stream_cases import Remembering

    class Counting:
        seen = 0

        def detect(self, image: ColourImage) -> Detections:
            self.seen += 1
            box = np.array([[0, 0, 2, 2]], np.float32)
            of = {"image_hw": image.rgb.shape[:2], "stamp_ns": image.stamp_ns, "frame_id": image.frame_id}
            return Detections(xyxy=box, score=np.ones(1, np.float32), label=("cup",), **of)

    counting = Counting()
    detector = Remembering(counting)  # type: ignore[arg-type]
    pictures = [np.full((4, 4, 3), value, np.uint8) for value in (7, 7, 8)]
    found = [detector.detect(ColourImage(rgb=p, stamp_ns=k, frame_id="camera")) for k, p in enumerate(pictures)]
    assert counting.seen == 2 and [f.stamp_ns for f in found] == [0, 1, 2]


def test_odometry_comes_at_50_hz_from_where_the_camera_began_and_the_body_of_a_robot_stays_level() -> None:
    from stream_grounds import _driven, drifted

    turned = [rotation_from_vector(np.array([0.0, 0.1 * k, 0.02 * k])) for k in range(5)]
    tilted = [pose(R @ ground("").T_body_camera[:3, :3], np.array([0.1 * k, 0.0, 1.0])) for k, R in enumerate(turned)]
    stamps, poses = zip(*drifted(Truth([(k * 10**8, T) for k, T in enumerate(tilted)]), 1), strict=True)
    assert stamps == tuple(range(0, 400_000_001, 20_000_000)) and np.allclose(poses[0], np.eye(4))
    bodies = [_driven(T, 1.2) @ inverse(ground("", is_level=True).T_body_camera) for T in tilted]
    assert np.allclose([T[2, :3] for T in bodies], [0, 0, 1]) and np.allclose([T[2, 3] for T in bodies], 0.1)


def test_the_cases_of_a_generator_are_the_names_at_the_line_starts_of_its_docstring(tmp_path: Path) -> None:
    from stream_generators import cases_of

    script = tmp_path / "odd.py"
    script.write_text(GENERATOR)
    assert cases_of(script) == ["plain", "body_cloud_tf", "far_8191"]


def test_a_generator_that_fails_is_a_refusal_with_what_it_said(tmp_path: Path) -> None:
    from stream_generators import Written, run_generator

    script = tmp_path / "odd.py"
    script.write_text("raise SystemExit('no data here')")
    row = run_generator(Written(script, "plain", tmp_path, 3, "model.onnx", 0.5))
    assert row["case"] == "odd:plain" and row["refused"].endswith("got exit 1: no data here")


@pytest.mark.parametrize("wrong", [("--kinds", "focal,x"), ("--parts", "x"), ("--simulate", "x:1"), ("--shared", ".")])
def test_a_command_line_that_cannot_be_followed_is_refused(wrong: tuple[str, str], tmp_path: Path) -> None:
    import streams

    result = CliRunner().invoke(streams.main, [*wrong, "--keep", str(tmp_path)])
    assert result.exit_code == click.UsageError.exit_code and "expected" in result.output
