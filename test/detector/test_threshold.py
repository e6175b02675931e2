# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest

from objreg_ros import share
from objreg_ros.detector.threshold import USUAL, own_threshold


def test_a_model_without_a_file_beside_it_has_the_usual_threshold(tmp_path: Path) -> None:
    assert own_threshold(tmp_path / "m.onnx") == USUAL == 0.5
    (tmp_path / "m.json").write_text('{"made": "elsewhere"}')
    assert own_threshold(tmp_path / "m.onnx") == USUAL


def test_the_threshold_of_the_coco_models_stands_in_the_file_that_is_put_beside_them() -> None:
    assert own_threshold(share.find("models/coco.txt")) == 0.4


@pytest.mark.parametrize("text", ["", "[0.4]", '{"threshold": "0.4"}', '{"threshold": 1.5}', '{"threshold": NaN}',
                                  '{"threshold": true}', "[" * 50_000])  # fmt: skip
def test_a_file_that_says_something_else_is_refused_with_its_name(text: str, tmp_path: Path) -> None:
    (tmp_path / "m.json").write_text(text)
    with pytest.raises(ValueError, match=r"m\.json: expected "):
        own_threshold(tmp_path / "m.onnx")
