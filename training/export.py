# SPDX-License-Identifier: Apache-2.0
"""Write a trained network as the ONNX file that `objreg_ros.detector` runs (docs/models-contract.md).

python -m training.export CHECKPOINT models/objreg_ssd.onnx --calibration DATA
"""

from __future__ import annotations

import argparse
import base64
import copy
import json
import tempfile
import warnings
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import cv2
import onnx
import torch
from torch import nn

from objreg_ros.data.checked import Array
from training.embedded import Embedded, FromPixels
from training.labels import LABELS
from training.network import MobileNetSsd
from training.priors import INPUT_HW, VARIANCES, make_priors
from training.quantise import quantise
from training.samples import Shard

OPSET = 13
"""Old enough for the onnxruntime of every supported system and for OpenCV's dnn."""

CALIBRATION_PICTURES = 60


def metadata(provenance: Mapping[str, str]) -> dict[str, str]:
    """What the detector must know of the model, and where the model comes from."""
    return {
        "objreg.contract": "ssd_raw/1",
        "objreg.labels": json.dumps(LABELS),
        "objreg.priors": base64.b64encode(make_priors().astype("<f4").tobytes()).decode(),
        "objreg.variances": json.dumps(VARIANCES),
        **{f"objreg.{key}": value for key, value in provenance.items()},
    }


def export(
    network: MobileNetSsd, path: Path, provenance: Mapping[str, str], calibration: Iterable[Array] | None = None
) -> None:
    """Write ``network`` in its evaluation form to ``path``; in int8 where there are pictures to calibrate it with.

    ``calibration``: pictures ``(H, W, 3) uint8`` of the network's size.
    """
    embedded = Embedded(copy.deepcopy(network)).to(memory_format=torch.contiguous_format).eval()
    with tempfile.TemporaryDirectory() as folder:
        raw = Path(folder) / "raw.onnx"
        if calibration is None:
            graph = _graph_of(FromPixels(embedded), torch.uint8, raw)
        else:
            graph = quantise(_graph_of(embedded, torch.float32, raw), calibration)
    onnx.helper.set_model_props(graph, metadata(provenance))
    onnx.checker.check_model(graph)
    path.parent.mkdir(parents=True, exist_ok=True)
    onnx.save(graph, str(path))


def _graph_of(module: nn.Module, dtype: torch.dtype, path: Path) -> onnx.ModelProto:
    """The module as a graph from ``rgb`` to ``loc`` and ``logits``."""
    with warnings.catch_warnings(), torch.no_grad():
        warnings.simplefilter("ignore")  # torch would rather have its other exporter, which needs more packages
        torch.onnx.export(
            module, (torch.zeros(1, *INPUT_HW, 3, dtype=dtype),), str(path), input_names=["rgb"],
            output_names=["loc", "logits"], opset_version=OPSET, dynamo=False,
        )  # fmt: skip
    return onnx.load(str(path))


def provenance_of(checkpoint: Mapping[str, object]) -> dict[str, str]:
    """The provenance of a checkpoint of `training.train`, as text."""
    return {
        "licence": "Apache-2.0",
        "trained_by": "training/ of objreg_ros, from random weights",
        "trained_on": "pictures of objreg_tools.simulation only",
        "steps": str(checkpoint["step"]),
        "seconds": f"{checkpoint['seconds']:.0f}",
        "command": str(checkpoint["command"]),
    }


def calibration_pictures(folder: Path) -> Iterator[Array]:
    """`CALIBRATION_PICTURES` pictures from all over a folder of shards, of the network's size."""
    shards = [Shard(path) for path in sorted(folder.glob("*.npz"))]
    if not shards:
        raise ValueError(f"{folder}: expected shards (*.npz), got none; run training.render first")
    for number in range(CALIBRATION_PICTURES):
        shard = shards[number * len(shards) // CALIBRATION_PICTURES]
        yield cv2.resize(shard[number % len(shard)].rgb, INPUT_HW[::-1])


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("checkpoint", type=Path)
    parser.add_argument("model", type=Path)
    parser.add_argument("--calibration", type=Path, help="shards from training.render; makes the model int8")
    arguments = parser.parse_args()
    checkpoint = torch.load(arguments.checkpoint, map_location="cpu", weights_only=True)
    network = MobileNetSsd(len(LABELS))
    network.load_state_dict(checkpoint["average"])
    pictures = calibration_pictures(arguments.calibration) if arguments.calibration else None
    export(network, arguments.model, provenance_of(checkpoint), pictures)
    print(f"{arguments.model}: {arguments.model.stat().st_size / 1e6:.2f} MB, step {checkpoint['step']}")


if __name__ == "__main__":
    main()
