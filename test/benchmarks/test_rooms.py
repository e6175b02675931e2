# SPDX-License-Identifier: Apache-2.0
"""Tests of how it is judged whether the right place is found among many rooms."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from click.testing import CliRunner
from registration.samples import box, keyframe

from objreg_ros.memory.sighting import Sighting, sightings_of
from objreg_ros.registrar.params import RegistrarParams
from objreg_ros.registration.keyframe import Keyframe

CUP, CHAIR = box("cup", (0.0, 0.0, 1.0)), box("chair", (0.0, 0.0, 1.5), 0.6)
PARAMS = RegistrarParams(candidates=1)


def _walk() -> list[Keyframe]:
    """A cup, a chair, and both again a minute later, in one session beside what is numbered below 100."""
    shown = enumerate((CUP, CHAIR, CUP, CHAIR))
    return [replace(keyframe(100 + k, 30.0 * k, (item,), 50), by_odometry=True) for k, item in shown]


def _right() -> np.ndarray:
    right = np.zeros((4, 4), bool)
    right[2, 0] = right[3, 1] = True
    return right


def _rooms(count: int) -> list[Sighting]:
    """So many other rooms with the very same chair."""
    return [s for k in range(count) for s in sightings_of(keyframe(1 + k, -900.0 - 30.0 * k, (CHAIR,), k))]


def test_what_could_close_is_found_if_a_right_one_is_among_the_tries_and_another_room_is_not_right() -> None:
    from rooms import found_among

    assert found_among(_walk(), _right(), PARAMS, [])[:3] == (4, 2, 2)
    assert found_among(_walk(), _right()[:, [1, 0, 2, 3]], PARAMS, [])[:3] == (4, 2, 0)


def test_a_restarted_robot_is_another_session_and_only_what_it_saw_before_is_right() -> None:
    from rooms import found_among, restarted

    right = _right()
    right[1, 0] = right[3, 2] = True  # within a half
    keyframes, across = restarted(_walk(), right)
    assert [keyframe.session for keyframe in keyframes] == [50, 50, 51, 51]
    assert np.argwhere(across).tolist() == [[2, 0], [3, 1]]
    assert found_among(keyframes, across, PARAMS, [])[:3] == (4, 2, 2)
    assert found_among(keyframes, across, PARAMS, _rooms(3))[:3] == (4, 2, 1)  # rooms as alike, and older


def test_without_recordings_it_says_what_it_needs_and_makes_no_rooms(tmp_path: Path) -> None:
    from rooms import main

    result = CliRunner().invoke(main, ["--keep", str(tmp_path)])
    assert result.exit_code == 2 and "expected RECORDINGS or --simulate SCENARIO:SEED, got neither" in " ".join(
        result.output.replace("│", "").split()
    )
    assert not list(tmp_path.iterdir())
