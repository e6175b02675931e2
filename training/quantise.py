# SPDX-License-Identifier: Apache-2.0
"""From a graph in floats to one in int8: four times as many products an instruction.

Weights are int8 by channel, activations uint8 by tensor, in the standard's QuantizeLinear and DequantizeLinear around
every operation (Jacob et al., "Quantization and Training of Neural Networks", 2018). The picture is uint8 already.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import onnx
from onnx import numpy_helper
from onnxruntime.quantization import CalibrationDataReader, QuantFormat, QuantType, quantize_static
from onnxruntime.quantization.shape_inference import quant_pre_process

from objreg_ros.data.checked import Array
from training.embedded import CENTRE, SCALE

INPUT = "rgb"

QUANTISED = ["Conv", "Relu", "Add", "Transpose", "Reshape", "Gather", "Gemm"]
"""The operations of the network; what only joins and parts the answers of its heads is not among them."""

ANSWERS = ["Gemm"]
"""The heads, whose sums become floats at once: precision is a matter of the order of the scores."""


class Pictures(CalibrationDataReader):  # type: ignore[misc]
    """Pictures ``(H, W, 3) uint8`` as the float graph takes them."""

    def __init__(self, pictures: Iterable[Array]) -> None:
        self._pictures = iter(pictures)

    def get_next(self) -> dict[str, Array] | None:
        """The next one; None at the end."""
        rgb = next(self._pictures, None)
        return None if rgb is None else {INPUT: ((rgb[None].astype(np.float32) - CENTRE) * SCALE).astype(np.float32)}


def quantise(graph: onnx.ModelProto, pictures: Iterable[Array]) -> onnx.ModelProto:
    """The int8 form of a graph whose one input `INPUT` is of centred pixels; its input is uint8 pixels.

    The range of an activation is the mean of its ranges in ``pictures``: the greatest would coarsen all for the sake of
    one. Weights have 7 bits: processors without VNNI add two products in 16 bits, where 8 bits may overflow.
    """
    with tempfile.TemporaryDirectory() as folder:
        paths = [str(Path(folder) / f"{name}.onnx") for name in ("floats", "ready", "int8")]
        onnx.save(graph, paths[0])
        quant_pre_process(paths[0], paths[1], skip_symbolic_shape=True)
        ready = _with_padding_in_convolutions(onnx.load(paths[1]))
        onnx.save(ready, paths[1])
        exact = {"scale": np.array(SCALE, np.float32), "zero_point": np.array(CENTRE, np.uint8)}
        quantize_static(
            paths[1], paths[2], Pictures(pictures), quant_format=QuantFormat.QDQ, per_channel=True, reduce_range=True,
            activation_type=QuantType.QUInt8, weight_type=QuantType.QInt8,
            op_types_to_quantize=QUANTISED,
            extra_options={
                "CalibMovingAverage": True, "TensorQuantOverrides": {_first_operand(ready): [exact]},
                "OpTypesToExcludeOutputQuantization": ANSWERS,
            },
        )  # fmt: skip
        return _of_own_operations(_from_pixels(onnx.load(paths[2])))


def _first_operand(model: onnx.ModelProto) -> str:
    """The pixels in the shape in which the first convolution takes them."""
    return str(next(node for node in model.graph.node if node.op_type == "Conv").input[0])


def _with_padding_in_convolutions(model: onnx.ModelProto) -> onnx.ModelProto:
    """The graph with the padding before a convolution as part of it, which torch cannot say where it is uneven."""
    graph = model.graph
    made_by = {node.output[0]: node for node in graph.node}
    constants = {value.name: value for value in graph.initializer}
    for convolution in [node for node in graph.node if node.op_type == "Conv"]:
        pad = made_by.get(convolution.input[0])
        if pad is not None and pad.op_type == "Pad":
            amounts = numpy_helper.to_array(constants[pad.input[1]]).reshape(2, 4)[:, 2:]
            own = next(attribute for attribute in convolution.attribute if attribute.name == "pads")
            own.ints[:] = [a + b for a, b in zip(own.ints, amounts.reshape(-1).tolist(), strict=True)]
            convolution.input[0] = pad.input[0]
            graph.node.remove(pad)
    return model


def _from_pixels(model: onnx.ModelProto) -> onnx.ModelProto:
    """The graph without the quantisation of its input: pixels are quantised already."""
    graph = model.graph
    first = next(node for node in graph.node if node.op_type == "QuantizeLinear")  # shapes alone change before it
    for node in graph.node:
        for place, name in enumerate(node.input):
            if name == first.output[0]:
                node.input[place] = first.input[0]
    graph.node.remove(first)
    del graph.value_info[:]
    graph.input[0].type.tensor_type.elem_type = onnx.TensorProto.UINT8
    return model


def _of_own_operations(model: onnx.ModelProto) -> onnx.ModelProto:
    """The graph without the names of sets of operations it has none of, which older onnxruntimes refuse to know."""
    used = {node.domain for node in model.graph.node}
    kept = [one for one in model.opset_import if one.domain in used]
    del model.opset_import[:]
    model.opset_import.extend(kept)
    return model
