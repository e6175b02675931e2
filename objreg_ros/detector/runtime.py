# SPDX-License-Identifier: Apache-2.0
"""An ONNX model in memory: the one file that knows onnxruntime."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import onnxruntime

from objreg_ros.data import Array


@dataclass(frozen=True)
class Port:
    """One input or output of a graph; a size that the graph leaves open is None."""

    name: str
    dtype: str
    shape: tuple[int | None, ...]

    def __str__(self) -> str:
        return f"{self.name} {self.dtype} [{', '.join('?' if size is None else str(size) for size in self.shape)}]"


class Runtime:
    """A loaded model: ``inputs``, ``outputs``, ``metadata``, and `run`. ValueError when the file is no ONNX model."""

    def __init__(self, path: Path, threads: int):
        if not path.is_file():
            raise ValueError(f"model {path}: expected a file, got none; name another or get one: objreg fetch-model")
        try:
            self._session = onnxruntime.InferenceSession(
                str(path), _options(threads), providers=["CPUExecutionProvider"]
            )
        except Exception as error:  # onnxruntime's errors share no base of their own
            raise ValueError(f"model {path}: expected an ONNX file that onnxruntime loads, got: {error}") from error
        self.inputs = tuple(_port(node) for node in self._session.get_inputs())
        self.outputs = tuple(_port(node) for node in self._session.get_outputs())
        self.metadata: dict[str, str] = dict(self._session.get_modelmeta().custom_metadata_map)

    def run(self, tensor: Array, outputs: tuple[str, ...]) -> list[Array]:
        """The named outputs for the one input."""
        return list(self._session.run(list(outputs), {self.inputs[0].name: tensor}))


def _options(threads: int) -> onnxruntime.SessionOptions:
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = 3
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.add_session_config_entry("session.inter_op.allow_spinning", "0")
    return options


def _port(node: onnxruntime.NodeArg) -> Port:
    dtype = node.type.removeprefix("tensor(").removesuffix(")")
    return Port(node.name, dtype, tuple(size if isinstance(size, int) else None for size in node.shape))
