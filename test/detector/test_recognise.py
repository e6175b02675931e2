# SPDX-License-Identifier: Apache-2.0
"""Which contract a model keeps."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from objreg_ros.detector.contract import Contract, Graph
from objreg_ros.detector.recognise import recognise
from objreg_ros.detector.runtime import Port


def of(
    shape: tuple[int, ...], labels: int = 80, metadata: Mapping[str, str] | None = None, named: str = "auto",
    hw: tuple[int, int] = (640, 640),
) -> Contract:  # fmt: skip
    probe = {"output0": np.zeros(shape, np.float32)}
    ports = (Port("images", "float", (1, 3, *hw)),), (Port("output0", "float", shape),)
    return recognise(Graph(*ports, metadata or {}, probe, labels, "auto", hw), named)


@pytest.mark.parametrize(
    ("shape", "labels", "kind"),
    [
        ((1, 25200, 85), 80, "YoloV5"),
        ((1, 84, 8400), 80, "YoloV8"),
        ((1, 8400, 84), 80, "YoloV8"),
        ((1, 300, 6), 80, "EndToEnd"),
        ((1, 8400, 85), 80, "YoloX"),
        ((1, 8500, 112), 80, "NanoDet"),
        ((1, 300, 84), 80, "DetrRows"),
        ((1, 6, 8400), 2, "YoloV8"),
        ((1, 8400, 6), 2, "YoloV8"),
        ((1, 25200, 6), 1, "YoloV5"),
        ((1, 8400, 6), 1, "YoloX"),
        ((1, 300, 6), 1, "EndToEnd"),
        ((1, 5, 8400), 1, "YoloV8"),
    ],
)
def test_the_number_of_labels_and_of_cells_give_the_contract(shape: tuple[int, ...], labels: int, kind: str) -> None:
    assert type(of(shape, labels)).__name__ == kind


def test_what_fits_two_contracts_is_refused_unless_metadata_or_a_name_decide() -> None:
    with pytest.raises(ValueError, match=r"expected one contract that fits 2 labels, got output0 \[1, 300, 6\], which "
                                         r"may be end_to_end or detr; name it with `contract`"):  # fmt: skip
        of((1, 300, 6), 2)
    assert type(of((1, 300, 6), 2, {"end2end": "True"})).__name__ == "EndToEnd"
    assert type(of((1, 300, 6), 2, {"args": "{'batch': 1, 'nms': True}"})).__name__ == "EndToEnd"
    assert type(of((1, 300, 6), 2, {"stride": "32"})).__name__ == "EndToEnd"
    assert type(of((1, 300, 6), 2, {"stride": "32", "description": "Ultralytics rtdetr-l"})).__name__ == "DetrRows"
    assert type(of((1, 300, 6), 2, named="detr")).__name__ == "DetrRows"


@pytest.mark.parametrize("named", ["auto", "yolov8", "yolov5", "end_to_end", "yolox", "nanodet", "detr"])
def test_other_labels_than_the_models_are_refused_with_expected_and_got(named: str) -> None:
    with pytest.raises(ValueError, match=r"expected those of .* for 7 labels, .*got output0 \[1, 84, 8400\]; give"):
        of((1, 84, 8400), 7, named=named)


def test_a_name_is_kept_where_another_contract_would_be_recognised() -> None:
    assert type(of((1, 8400, 85), named="yolov5")).__name__ == "YoloV5"
    with pytest.raises(ValueError, match=r"expected boxes \[1,N,4\]"):
        of((1, 84, 8400), named="tf_detection")
    with pytest.raises(ValueError, match=r"expected objreg.contract"):
        of((1, 84, 8400), named="ssd_raw")


@pytest.mark.parametrize("task", ["pose", "obb", "classify"])
def test_a_model_of_another_task_is_refused(task: str) -> None:
    with pytest.raises(ValueError, match=rf"expected detect or segment, got '{task}'"):
        of((1, 56, 8400), 1, {"task": task})
