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
    sizes: bool = False,
) -> Path:
    """A model that gives ``outputs`` for any picture (it reads the picture and adds zero times its sum).

    With ``sizes`` it has a second input orig_target_sizes, width and height, and its ``boxes`` are shares of these.
    """
    floats = onnx.TensorProto.FLOAT
    nodes = [
        onnx.helper.make_node("Cast", [input_name], ["cast"], to=floats),
        onnx.helper.make_node("ReduceSum", ["cast"], ["sum"], keepdims=0),
        onnx.helper.make_node("Mul", ["sum", "zero"], ["nothing"]),
    ]
    constants = [onnx.numpy_helper.from_array(np.float32(0).reshape(()), "zero")]
    for name, value in outputs.items():
        constants.append(onnx.numpy_helper.from_array(np.asarray(value, np.float32), f"{name}/constant"))
        is_scaled = sizes and name == "boxes"
        nodes.append(onnx.helper.make_node("Add", [f"{name}/constant", "nothing"], ["shares" if is_scaled else name]))
        if is_scaled:
            nodes.append(onnx.helper.make_node("Concat", ["orig_target_sizes"] * 2, ["twice"], axis=1))
            nodes.append(onnx.helper.make_node("Cast", ["twice"], ["pixels"], to=floats))
            nodes.append(onnx.helper.make_node("Mul", ["shares", "pixels"], [name]))
    shown = [onnx.helper.make_tensor_value_info(name, floats, np.shape(value)) for name, value in outputs.items()]
    picture = onnx.helper.make_tensor_value_info(input_name, dtype, input_shape)
    ports = [picture, onnx.helper.make_tensor_value_info("orig_target_sizes", onnx.TensorProto.INT64, (1, 2))]
    graph = onnx.helper.make_graph(nodes, "tiny", ports[: 1 + sizes], shown, constants)
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


def save_seeing_model(
    path: Path,
    row_of_xyxy: np.ndarray,
    hw: tuple[int, int] = (64, 96),
    shape: tuple[int, ...] = (1, 1, -1),
    outputs: Mapping[str, np.ndarray] | None = None,
    metadata: Mapping[str, str] | None = None,
) -> Path:
    """A network that finds the bright rectangle of its picture, values above 0.9, and gives its edges in ``output0``.

    ``row_of_xyxy (5, K)`` makes the row of x_min, y_min, x_max, y_max in pixels and 1. ``outputs`` are constants.
    """
    make, floats = onnx.helper.make_node, onnx.TensorProto.FLOAT
    nodes, edges = [make("Greater", ["images", "least"], ["bright"]), make("Cast", ["bright"], ["b"], to=floats)], []
    for axis, others in ((3, [0, 1, 2]), (2, [0, 1, 3])):
        name = f"a{axis}"
        nodes.append(make("ReduceMax", ["b"], [name], axes=others, keepdims=0))
        for last in (0, 1):
            edge = f"{name}_{last}"
            nodes.append(make("ArgMax", [name], [f"{edge}i"], axis=0, keepdims=1, select_last_index=last))
            nodes.append(make("Cast", [f"{edge}i"], [edge], to=floats))
            edges.append(edge)
    nodes.append(make("Concat", [edges[0], edges[2], edges[1], edges[3], "one"], ["first"], axis=0))
    nodes += [make("MatMul", ["first", "rows"], ["row"]), make("Reshape", ["row", "shape"], ["output0"])]
    outside = np.vstack([row_of_xyxy[:4], row_of_xyxy[2:].sum(axis=0)])  # the last pixel ends one later
    constants = {"least": np.float32(0.9), "one": np.ones(1, np.float32), "rows": outside.astype(np.float32),
                 "shape": np.array(shape, np.int64)}  # fmt: skip
    for name, value in (outputs or {}).items():
        constants[f"{name}/constant"] = np.asarray(value, np.float32)
        nodes.append(make("Identity", [f"{name}/constant"], [name]))
    held = [onnx.numpy_helper.from_array(np.asarray(value), name) for name, value in constants.items()]
    size = row_of_xyxy.shape[1]
    shown = [onnx.helper.make_tensor_value_info("output0", floats, [size if one == -1 else one for one in shape])]
    shown += [
        onnx.helper.make_tensor_value_info(name, floats, np.shape(value)) for name, value in (outputs or {}).items()
    ]
    picture = onnx.helper.make_tensor_value_info("images", floats, (1, 3, *hw))
    graph = onnx.helper.make_graph(nodes, "tiny", [picture], shown, held)
    model = onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 17)], ir_version=8)
    onnx.helper.set_model_props(model, dict(metadata or {}))
    onnx.save(model, path)
    return path


def centred(*scores: float, width: float = 1.0, height: float = 1.0) -> np.ndarray:
    """The matrix (5, 4 + C) that makes cx cy w h, as shares of ``width`` and ``height``, and those scores."""
    share = np.array([[0.5, 0, -1, 0], [0, 0.5, 0, -1], [0.5, 0, 1, 0], [0, 0.5, 0, 1]])
    share = share / [width, height, width, height]
    return np.hstack([np.vstack([share, np.zeros(4)]), np.vstack([np.zeros((4, len(scores))), scores])])
