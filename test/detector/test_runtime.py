# SPDX-License-Identifier: Apache-2.0
"""Loading of ONNX files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnxruntime
import pytest

from objreg_ros.detector.runtime import SPIN_US, Port, Runtime, make_options

from .tiny_model import save_constant_model


def test_a_graph_shows_its_ports_and_metadata_and_runs(tmp_path: Path) -> None:
    path = save_constant_model(
        tmp_path / "m.onnx", {"answer": np.array([[4.0]])}, input_shape=(1, "h", "w", 3), metadata={"who": "we"}
    )
    runtime = Runtime(path, threads=1)
    assert runtime.inputs == (Port("picture", "uint8", (1, None, None, 3)),)
    assert runtime.outputs == (Port("answer", "float", (1, 1)),)
    assert runtime.metadata == {"who": "we"}
    assert runtime.run(np.ones((1, 2, 2, 3), np.uint8), ("answer",))[0].tolist() == [[4.0]]


def test_a_picture_that_the_graph_does_not_take_is_refused(tmp_path: Path) -> None:
    runtime = Runtime(save_constant_model(tmp_path / "m.onnx", {"answer": np.zeros((1, 1))}), threads=1)
    with pytest.raises(ValueError, match=r"expected it to run on a picture \[1, 2, 2, 3\], as its input is picture"):
        runtime.run(np.ones((1, 2, 2, 3), np.uint8), ("answer",))


def test_a_missing_file_is_refused_with_a_way_out(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"expected a file, got none.*objreg fetch-model"):
        Runtime(tmp_path / "none.onnx", threads=1)


@pytest.mark.parametrize("content", [b"", b"this is no model at all", b"\x08\x08" + bytes(100)])
def test_a_file_that_is_no_model_is_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "text.onnx"
    path.write_bytes(content)
    with pytest.raises(ValueError, match="expected an ONNX file that onnxruntime loads, got"):
        Runtime(path, threads=1)


@pytest.mark.parametrize(("version", "spins"), [("1.17.3", "0"), ("1.25.0", "0"), ("1.26.1", "1"), ("2.0.0", "1")])
def test_threads_spin_only_within_a_picture_and_only_where_that_is_brief(
    version: str, spins: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(onnxruntime, "__version__", version)
    entry = make_options(2).get_session_config_entry
    assert entry("session.intra_op.allow_spinning") == spins and entry("session.inter_op.allow_spinning") == "0"
    assert entry("session.intra_op.spin_duration_us") == str(SPIN_US) and entry("session.force_spinning_stop") == "1"
