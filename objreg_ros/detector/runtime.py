# SPDX-License-Identifier: Apache-2.0
"""An ONNX model in memory: the one file that knows onnxruntime."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import onnxruntime

from objreg_ros.data.checked import Array

REMEDY = "check the download, or export the model again"
SPIN_US = 10
"""So long a thread stays awake for the next operation on the same picture, since to wake it takes longer. On two cores
a picture takes a tenth less time so, on a busy machine about the same, and not more of the processor."""

SPINS_BRIEFLY = (1, 26)
"""The first onnxruntime that can. Older ones would spin for milliseconds, half as long again on a busy machine."""


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
                str(path), make_options(threads), providers=["CPUExecutionProvider"]
            )
        except Exception as error:  # onnxruntime's errors share no base of their own
            raise ValueError(
                f"model {path}: expected an ONNX file that onnxruntime loads, got: {error}; {REMEDY}"
            ) from error
        self.inputs = tuple(_port(node) for node in self._session.get_inputs())
        self.outputs = tuple(_port(node) for node in self._session.get_outputs())
        self.metadata: dict[str, str] = dict(self._session.get_modelmeta().custom_metadata_map)

    def run(
        self, tensor: Array, outputs: tuple[str, ...], extra: Mapping[str, Array] = MappingProxyType({})
    ) -> list[Array]:
        """The named outputs for the picture and ``extra`` inputs; ValueError where the graph does not compute them."""
        try:
            return list(self._session.run(list(outputs), {self.inputs[0].name: tensor, **extra}))
        except Exception as error:  # onnxruntime's errors share no base of their own
            raise ValueError(
                f"model: expected it to run on a picture {list(tensor.shape)}, as its input is {self.inputs[0]}, "
                f"got: {error}; export the model again for pictures of that size"
            ) from error


def make_options(threads: int) -> onnxruntime.SessionOptions:
    """How onnxruntime is asked to run."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = 3
    brief = tuple(int(part) for part in onnxruntime.__version__.split(".")[:2]) >= SPINS_BRIEFLY
    options.add_session_config_entry("session.intra_op.allow_spinning", "1" if brief else "0")
    options.add_session_config_entry("session.intra_op.spin_duration_us", str(SPIN_US))
    options.add_session_config_entry("session.force_spinning_stop", "1")  # none while no picture is there
    options.add_session_config_entry("session.inter_op.allow_spinning", "0")
    return options


def _port(node: onnxruntime.NodeArg) -> Port:
    dtype = node.type.removeprefix("tensor(").removesuffix(")")
    return Port(node.name, dtype, tuple(size if isinstance(size, int) else None for size in node.shape))
