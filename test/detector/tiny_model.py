# SPDX-License-Identifier: Apache-2.0
"""Tiny ONNX detection models with known answers, made on the spot."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import onnx

TFLITE = ("TFLite_Detection_PostProcess", "TFLite_Detection_PostProcess:1", "TFLite_Detection_PostProcess:2",
          "TFLite_Detection_PostProcess:3")  # fmt: skip
TF_API = ("detection_boxes:0", "detection_classes:0", "detection_scores:0", "num_detections:0")


def save_constant_model(
    path: Path,
    outputs: Mapping[str, np.ndarray],
    input_shape: tuple[Any, ...] = (1, 30, 40, 3),
    input_name: str = "picture",
    dtype: int = onnx.TensorProto.UINT8,
    metadata: Mapping[str, str] | None = None,
) -> Path:
    """A model that gives ``outputs`` for any picture (it reads the picture and adds zero times its sum)."""
    floats = onnx.TensorProto.FLOAT
    nodes = [
        onnx.helper.make_node("Cast", [input_name], ["cast"], to=floats),
        onnx.helper.make_node("ReduceSum", ["cast"], ["sum"], keepdims=0),
        onnx.helper.make_node("Mul", ["sum", "zero"], ["nothing"]),
    ]
    constants = [onnx.numpy_helper.from_array(np.float32(0).reshape(()), "zero")]
    for name, value in outputs.items():
        constants.append(onnx.numpy_helper.from_array(np.asarray(value, np.float32), f"{name}/constant"))
        nodes.append(onnx.helper.make_node("Add", [f"{name}/constant", "nothing"], [name]))
    shown = [onnx.helper.make_tensor_value_info(name, floats, np.shape(value)) for name, value in outputs.items()]
    picture = onnx.helper.make_tensor_value_info(input_name, dtype, input_shape)
    graph = onnx.helper.make_graph(nodes, "tiny", [picture], shown, constants)
    model = onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 17)], ir_version=8)
    onnx.helper.set_model_props(model, dict(metadata or {}))
    onnx.save(model, path)
    return path


def tf_outputs(
    boxes: Any, classes: Any, scores: Any, names: tuple[str, ...] = TFLITE, count: int | None = None
) -> dict[str, np.ndarray]:
    """The outputs of a post-processed model under ``names``: boxes are y_min x_min y_max x_max in 0..1."""
    values = (np.array([boxes]), np.array([classes]), np.array([scores]), [len(boxes) if count is None else count])
    return {name: np.asarray(value, np.float32) for name, value in zip(names, values, strict=False)}


def raw_metadata(priors: np.ndarray, labels: list[str]) -> dict[str, str]:
    """The metadata of a model with raw heads."""
    return {
        "objreg.contract": "ssd_raw/1",
        "objreg.labels": json.dumps(labels),
        "objreg.priors": base64.b64encode(priors.astype("<f4").tobytes()).decode(),
        "objreg.variances": "[0.1, 0.1, 0.2, 0.2]",
    }
