# SPDX-License-Identifier: Apache-2.0
"""Which contract a model keeps, by its metadata, the names and shapes of its outputs and the number of labels."""

from __future__ import annotations

from objreg_ros.detector.contract import Contract, Graph, shapes
from objreg_ros.detector.detr import DECODED, QUERIED, DetrOutput, DetrQueries, DetrRows
from objreg_ros.detector.grid import NanoDet, YoloX, strides_of
from objreg_ros.detector.picture import SIZES
from objreg_ros.detector.raw_ssd import RawSsd
from objreg_ros.detector.tf_detection import TfDetection
from objreg_ros.detector.yolo import EndToEnd, YoloV5, YoloV8

HEADS: dict[str, type[YoloV5 | YoloV8 | EndToEnd | YoloX | NanoDet | DetrRows]] = {
    "yolov5": YoloV5, "yolov8": YoloV8, "end_to_end": EndToEnd, "yolox": YoloX, "nanodet": NanoDet, "detr": DetrRows,
}  # fmt: skip
"""The contracts of one output of three dimensions, by the name that the parameter ``contract`` has for them."""

TASKS = ("detect", "segment")


def recognise(graph: Graph, named: str = "auto") -> Contract:
    """The contract that a graph keeps, or ``named``, which it has to keep.

    ValueError says what was expected and what the graph has, and asks for a name where more than one contract fits.
    """
    task = graph.metadata.get("task", TASKS[0])
    if task not in TASKS:
        raise ValueError(f"task of the model: expected {' or '.join(TASKS)}, got {task[:80]!r}; export a detector")
    if named == "ssd_raw" or (named == "auto" and _is_raw_ssd(graph)):
        return RawSsd.of(graph)
    if named in ("auto", "detr") and set(QUERIED) <= set(graph.probe):
        return DetrQueries.of(graph)
    sizes = any(port.name == SIZES for port in graph.inputs)
    if set(DECODED) <= set(graph.probe) and (named == "detr" or (named == "auto" and sizes)):
        return DetrOutput.of(graph)
    if named == "tf_detection" or (named == "auto" and _is_tf_detection(graph)):
        return TfDetection.of(graph)
    return _of_head(graph, named)


def _is_raw_ssd(graph: Graph) -> bool:
    return "objreg.contract" in graph.metadata or {"loc", "logits"} <= set(graph.probe)


def _is_tf_detection(graph: Graph) -> bool:
    """Whether there are several outputs and one is boxes, or none is a head: that contract reports what is absent."""
    several = len(graph.probe) > 1 + bool(graph.masks)
    boxes = any(value.ndim == 3 and value.shape[2] == 4 for value in graph.probe.values())
    return graph.head is None or (several and boxes)


def _of_head(graph: Graph, named: str) -> Contract:
    """The contract of a model with one output for boxes and scores."""
    head = graph.head
    shape = () if head is None else graph.probe[head].shape
    fitting = [] if head is None else [name for name, kind in HEADS.items() if kind.fits(graph, shape)]
    if head is None or (named == "auto" and not fitting) or (named != "auto" and named not in fitting):
        raise ValueError(
            f"outputs of the model: expected those of {'a known contract' if named == 'auto' else named} for "
            f"{graph.labels} labels, as [1,5+C] a row of yolov5 and yolox, [1,4+C] of yolov8 and detr, [1,6] of "
            f"end_to_end, or [1,C+4(R+1)] of nanodet, got {shapes(graph.probe)}; give the model's own `labels`, or "
            "name its `contract`"
        )
    names = [named] if named != "auto" else _narrowed(graph, fitting, shape)
    if len(names) != 1:
        raise ValueError(
            f"outputs of the model: expected one contract that fits {graph.labels} labels, got {shapes(graph.probe)}, "
            f"which may be {' or '.join(names or fitting)}; name it with `contract`"
        )
    return HEADS[names[0]].of(graph, head)


def _narrowed(graph: Graph, fitting: list[str], shape: tuple[int, ...]) -> list[str]:
    """Those of the fitting contracts that the metadata allow, and the number of rows where that leaves several."""
    metadata = graph.metadata
    chosen = metadata.get("end2end") == "True" or "'nms': True" in metadata.get("args", "")
    if chosen and "end_to_end" in fitting:
        return ["end_to_end"]
    if "rtdetr" in metadata.get("description", "").lower() and "detr" in fitting:
        return ["detr"]
    if "stride" in metadata:  # Ultralytics wrote it, and YOLOv5 before
        fitting = [name for name in fitting if name in ("yolov5", "yolov8", "end_to_end")]
    if len(fitting) == 1:
        return fitting
    return [name for name in fitting if _rows_fit(graph, name, shape)]


def _rows_fit(graph: Graph, name: str, shape: tuple[int, ...]) -> bool:
    """Whether a head has as many rows as the grids of its contract have cells, or another number without a grid."""
    if name == "yolov8":
        rows = shape[2] if shape[1] == 4 + graph.labels + graph.masks else shape[1]
        return strides_of(rows, graph.hw) is not None
    whole = strides_of(shape[1], graph.hw)
    thrice = shape[1] % 3 == 0 and strides_of(shape[1] // 3, graph.hw) is not None
    if name == "nanodet":
        return whole == (8, 16, 32, 64)
    if name == "yolov5":
        return thrice
    return whole is not None if name == "yolox" else whole is None and not thrice
