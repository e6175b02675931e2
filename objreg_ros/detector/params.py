# SPDX-License-Identifier: Apache-2.0
"""The parameters of the detector."""

from __future__ import annotations

from dataclasses import dataclass

from objreg_ros.params import Params, param


@dataclass(frozen=True)
class DetectorParams(Params):
    """What the detector runs and which of its boxes go on."""

    model: str = param(
        "auto",
        "ONNX model: a path, or a file name in models/ or in the user's data folder; auto: a COCO model that `objreg "
        "fetch-model` brought, else objreg_ssd.onnx",
    )
    labels: str = param(
        "",
        "file of one label a line, or YAML with names:; empty: from the model's metadata, or a file beside the model",
    )
    label_offset: str = param(
        "auto", "number of the first class: 0 (converted TFLite), 1 (TF detection API)", choices=("auto", "0", "1")
    )
    contract: str = param(
        "auto", "what the model's outputs mean; auto: by their names and shapes and the number of labels",
        choices=("auto", "tf_detection", "ssd_raw", "yolov5", "yolov8", "end_to_end", "yolox", "nanodet", "detr"),
    )  # fmt: skip
    threshold: float = param(
        0.0, "least score of a detection; 0: that of the model, 0.5 where it says none", ge=0.0, le=1.0, live=True
    )
    nms_iou: float = param(0.5, "two boxes of one label that overlap more are one object", ge=0.0, le=1.0, live=True)
    cross_label_iou: float = param(
        0.85, "two boxes of different labels that overlap more are one object; the better label wins", ge=0.0, le=1.0,
        live=True,
    )  # fmt: skip
    max_detections: int = param(30, "most detections of one image", ge=1, le=1000, live=True)
    max_candidates: int = param(300, "most boxes that enter the suppression of overlaps", ge=1, le=10000)
    ignore: tuple[str, ...] = param(
        ("dining table",), "labels that are never passed on; not people: the segmenter leaves them out", live=True
    )
    min_side: float = param(8.0, "least width and height of a box", unit="px", ge=0.0, live=True)
    max_area: float = param(1.0, "largest share of the image that a box may cover", ge=0.0, le=1.0, live=True)
    max_rate: float = param(
        15.0, "most pictures a second that are looked at, by their stamps; those between are surplus; 0: every picture",
        unit="Hz", ge=0.0, le=1000.0,
    )  # fmt: skip
    threads: int = param(2, "threads of the inference, which never spin while idle", ge=1, le=64)
