# SPDX-License-Identifier: Apache-2.0
"""The int8 form of a network must answer nearly as the one in floats does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
import torch

from training.export import OPSET, export
from training.labels import LABELS
from training.network import MobileNetSsd
from training.priors import INPUT_HW


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The same random network in floats and in int8."""
    torch.manual_seed(4)
    network = MobileNetSsd(len(LABELS)).eval()
    for head in network.heads:
        torch.nn.init.normal_(head.weight, std=0.3)
    folder = tmp_path_factory.mktemp("models")
    export(network, folder / "floats.onnx", {})
    export(network, folder / "int8.onnx", {}, [picture(seed) for seed in range(3)])
    return folder / "floats.onnx", folder / "int8.onnx"


def picture(seed: int) -> np.ndarray:
    """Coloured squares."""
    rng = np.random.default_rng(seed)
    return rng.integers(0, 256, (INPUT_HW[0] // 32, INPUT_HW[1] // 32, 3), np.uint8).repeat(32, 0).repeat(32, 1)


def answers(path: Path) -> list[np.ndarray]:
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    return session.run(["loc", "logits"], {"rgb": picture(7)[None]})


def test_int8_answers_stay_near_those_in_floats(models: tuple[Path, Path]) -> None:
    for floats, int8 in zip(*map(answers, models), strict=True):
        assert floats.shape == int8.shape and floats.dtype == int8.dtype == np.float32
        assert np.corrcoef(floats.ravel(), int8.ravel())[0, 1] > 0.98


def test_the_int8_model_is_small_and_takes_pixels_without_a_value_in_floats(models: tuple[Path, Path]) -> None:
    model = onnx.load(str(models[1]))
    assert model.graph.input[0].type.tensor_type.elem_type == onnx.TensorProto.UINT8
    assert models[1].stat().st_size < 0.45 * models[0].stat().st_size
    assert {node.op_type for node in model.graph.node}.isdisjoint({"Cast", "Sub", "Div", "Mul", "Pad", "Relu"})


def test_nothing_between_pixels_and_answers_is_in_floats_or_known_to_new_runtimes_alone(
    models: tuple[Path, Path],
) -> None:
    model = onnx.load(str(models[1]))
    made_by = {name: node.op_type for node in model.graph.node for name in node.output}
    products = [node for node in model.graph.node if node.op_type in ("Conv", "Gemm")]
    assert {made_by[name] for node in products for name in node.input[:2]} == {"DequantizeLinear"}
    assert "Resize" not in made_by.values() and list(made_by.values()).count("Gemm") == 5
    assert [(one.domain, one.version) for one in model.opset_import] == [("", OPSET)]


def test_weights_leave_the_headroom_that_processors_without_vnni_need(models: tuple[Path, Path]) -> None:
    kernels = [onnx.numpy_helper.to_array(value) for value in onnx.load(str(models[1])).graph.initializer
               if value.data_type == onnx.TensorProto.INT8 and len(value.dims) == 4]  # fmt: skip
    assert kernels and max(np.abs(kernel.astype(int)).max() for kernel in kernels) <= 64
