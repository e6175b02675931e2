# SPDX-License-Identifier: Apache-2.0
"""An exported network must be what the detector takes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx  # noqa: F401  (the export needs it)
import torch

from objreg_ros.data.images import ColourImage
from objreg_ros.detector.detector import Detector
from objreg_ros.detector.params import DetectorParams
from training.export import export
from training.labels import LABELS
from training.network import MobileNetSsd


def test_a_network_that_sees_one_thing_is_exported_and_seen_by_the_detector(tmp_path: Path) -> None:
    torch.manual_seed(0)
    network = MobileNetSsd(len(LABELS)).eval()
    with torch.no_grad():  # the coarsest level always says "bowl"
        network.heads[-1].bias[4 + LABELS.index("bowl")] = 20.0
    export(network, tmp_path / "m.onnx", {"licence": "Apache-2.0"})
    assert (tmp_path / "m.onnx").stat().st_size < 6e6
    detector = Detector(DetectorParams(), tmp_path / "m.onnx")
    seen = detector.detect(ColourImage(rgb=np.zeros((480, 640, 3), np.uint8), stamp_ns=0))
    assert detector.labels == LABELS and set(seen.label) == {"bowl"}
