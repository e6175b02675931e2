# SPDX-License-Identifier: Apache-2.0
"""Which nodes the command of one process starts; `ros/test_graph.py` has it alive."""

from __future__ import annotations

import pytest

from objreg_tools.graph import STAGES, chosen


def test_without_names_it_is_the_three_stages() -> None:
    assert chosen([]) == chosen(["--ros-args", "-p", "detector:threshold:=0.4"]) == list(STAGES)


def test_nodes_are_made_in_the_order_of_a_frame_whatever_the_order_of_their_names() -> None:
    assert chosen(["mapper", "registrar", "segmenter"]) == ["segmenter", "registrar", "mapper"]


def test_a_name_that_there_is_not_ends_it_with_the_names_there_are(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        chosen(["detectr"])
    assert "expected nodes of detector, segmenter, registrar, keyframer, mapper, got detectr" in capsys.readouterr().err
