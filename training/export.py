# SPDX-License-Identifier: Apache-2.0
"""Write a trained network as the ONNX file that `objreg_ros.detector` runs (ARCHITECTURE.md, section 8).

python -m training.export CHECKPOINT models/objreg_ssd.onnx
"""

from __future__ import annotations

import argparse
import base64
import json
import tempfile
import warnings
from collections.abc import Mapping
from pathlib import Path

import onnx
import torch
from torch import Tensor, nn
from torch.nn import functional

from training.labels import LABELS
from training.network import MobileNetSsd
from training.priors import INPUT_HW, VARIANCES, make_priors

OPSET = 13
"""Old enough for the onnxruntime of every supported system and for OpenCV's dnn."""


class Embedded(nn.Module):
    """The network behind its normalisation: ``(1, H, W, 3)`` uint8 RGB in, ``loc`` and ``logits`` out.

    Log odds of the classes beside a background of 0 are logits for a softmax: for one likely class it is the sigmoid.
    """

    def __init__(self, network: MobileNetSsd) -> None:
        super().__init__()
        self.network = network

    def forward(self, rgb: Tensor) -> tuple[Tensor, Tensor]:
        x = rgb.permute(0, 3, 1, 2).to(torch.float32)
        loc, odds = self.network((x - 127.5) / 127.5)
        return loc, functional.pad(odds, (1, 0))


def metadata(provenance: Mapping[str, str]) -> dict[str, str]:
    """What the detector must know of the model, and where the model comes from."""
    return {
        "objreg.contract": "ssd_raw/1",
        "objreg.labels": json.dumps(LABELS),
        "objreg.priors": base64.b64encode(make_priors().astype("<f4").tobytes()).decode(),
        "objreg.variances": json.dumps(VARIANCES),
        **{f"objreg.{key}": value for key, value in provenance.items()},
    }


def export(network: MobileNetSsd, path: Path, provenance: Mapping[str, str]) -> None:
    """Write ``network`` in its evaluation form to ``path``."""
    model = Embedded(network.eval()).to(memory_format=torch.contiguous_format)
    picture = torch.zeros(1, *INPUT_HW, 3, dtype=torch.uint8)
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings(), torch.no_grad():
        warnings.simplefilter("ignore")  # torch would rather have its other exporter, which needs more packages
        raw = Path(folder) / "raw.onnx"
        torch.onnx.export(
            model, (picture,), str(raw), input_names=["rgb"], output_names=["loc", "logits"],
            opset_version=OPSET, dynamo=False,
        )  # fmt: skip
        graph = onnx.load(str(raw))
    onnx.helper.set_model_props(graph, metadata(provenance))
    onnx.checker.check_model(graph)
    path.parent.mkdir(parents=True, exist_ok=True)
    onnx.save(graph, str(path))


def provenance_of(checkpoint: Mapping[str, object]) -> dict[str, str]:
    """The provenance of a checkpoint of `training.train`, as text."""
    return {
        "licence": "Apache-2.0",
        "trained_by": "training/ of objreg_ros, from random weights",
        "trained_on": "pictures of objreg_ros.simulation only",
        "steps": str(checkpoint["step"]),
        "seconds": f"{checkpoint['seconds']:.0f}",
        "command": str(checkpoint["command"]),
    }


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("checkpoint", type=Path)
    parser.add_argument("model", type=Path)
    parser.add_argument("--history", help="how it came about, where the last command does not tell it all")
    arguments = parser.parse_args()
    checkpoint = torch.load(arguments.checkpoint, map_location="cpu", weights_only=True)
    network = MobileNetSsd(len(LABELS))
    network.load_state_dict(checkpoint["average"])
    history = {"history": arguments.history} if arguments.history else {}
    export(network, arguments.model, provenance_of(checkpoint) | history)
    print(f"{arguments.model}: {arguments.model.stat().st_size / 1e6:.2f} MB, step {checkpoint['step']}")


if __name__ == "__main__":
    main()
