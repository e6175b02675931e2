# SPDX-License-Identifier: Apache-2.0
"""How nodes start, what they refuse, what they miss and how they end."""

from __future__ import annotations

import signal
import subprocess
from pathlib import Path

import pytest

from .graph import REPOSITORY, START_S, Graph

pytestmark = pytest.mark.ros


def start(graph: Graph, stage: str, *ros_args: str) -> subprocess.CompletedProcess[str]:
    """Run a node that is expected to end by itself."""
    return subprocess.run(
        graph.command(stage, *ros_args), env=graph.environment(), capture_output=True, text=True, timeout=START_S
    )


@pytest.mark.parametrize("content", [None, b"this is no model"])
def test_a_wrong_model_file_ends_the_detector_with_one_clear_line(
    graph: Graph, tmp_path: Path, content: bytes | None
) -> None:
    model = tmp_path / "wrong.onnx"
    if content is not None:
        model.write_bytes(content)
    ended = start(graph, "detector", f"-p model:={model}")
    assert ended.returncode == 1
    (line,) = ended.stderr.strip().splitlines()
    assert "wrong.onnx" in line and "expected" in line


def test_a_parameter_out_of_range_ends_a_node_with_the_message_of_params(graph: Graph) -> None:
    ended = start(graph, "segmenter", "-p slop:=-1.0")
    assert (ended.returncode, ended.stderr.strip()) == (1, "segmenter: slop: expected at least 0, got -1.0")


@pytest.mark.parametrize("namespace", ["/", "/robot"])
@pytest.mark.parametrize(
    ("stage", "file", "setting", "wrong"),
    [
        ("mapper", "config/objreg.yaml", "keyframe_translation: 0.25", "keyframe_translation: -5.0"),
        ("registrar", "config/covariance.yaml", "covariance_scale: 0.45", "covariance_scale: -5.0"),
    ],
)
def test_a_copy_of_our_parameter_files_is_read_in_any_namespace(
    graph: Graph, tmp_path: Path, stage: str, file: str, setting: str, wrong: str, namespace: str
) -> None:
    text = (REPOSITORY / file).read_text()
    assert setting in text
    (tmp_path / "own.yaml").write_text(text.replace(setting, wrong))
    ended = start(graph, stage, f"--params-file {tmp_path}/own.yaml", f"-r __ns:={namespace}")
    assert ended.returncode == 1 and wrong.split(":")[0] in ended.stderr and "got -5.0" in ended.stderr


def test_a_node_says_which_topic_is_missing_and_how_to_remap_it_and_keeps_running(
    graph: Graph, tiny_model: Path
) -> None:
    graph.start("/lonely", "detector", f"-p model:={tiny_model}", "-r __node:=lonely", "-p silence:=0.5")
    graph.wait_for(lambda: "no publisher" in graph.log("/lonely"), START_S, "a line about the missing image")
    log = graph.log("/lonely")
    assert "nothing on /image or /image/compressed" in log and "--ros-args -r image:=/your/topic" in log
    assert "shared memory for big messages" in log
    assert graph.alive("/lonely") and graph.stop("/lonely", signal.SIGTERM) == 0
