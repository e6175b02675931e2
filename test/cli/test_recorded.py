# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from recording.folders import tum_folder

from objreg_ros.cli.recorded import Asked
from objreg_ros.cli.settings import read_settings

NOTHING = {"model": None, "labels": None, "camera": "", "params_file": None, "changes": (), "remaps": ()}


def test_named_options_are_settings_of_the_nodes() -> None:
    asked = Asked.of(**{**NOTHING, "labels": "names.txt"}, odometry=None, max_frames=None)
    assert asked.settings.changed() == {"detector.labels": "names.txt"}


def test_a_drift_without_a_seed_is_refused() -> None:
    with pytest.raises(ValueError, match="expected drift: and a seed"):
        Asked.of(**NOTHING, odometry="drift:", max_frames=None)


def test_no_more_frames_are_expected_than_are_asked_for(tmp_path: Path) -> None:
    asked = Asked(read_settings(None, ()))
    folder = tum_folder(tmp_path, frames=4)
    with asked.opened(folder) as whole, replace(asked, max_frames=3).opened(folder) as part:
        assert (whole.frames, part.frames) == (4, 3) and whole.inputs.depth == "/depth/image"
        assert whole.notes == ()
