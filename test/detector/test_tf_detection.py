# SPDX-License-Identifier: Apache-2.0
"""What the outputs of a post-processed TF graph mean."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from objreg_ros.detector.contract import Graph
from objreg_ros.detector.recognise import recognise
from objreg_ros.detector.runtime import Port
from objreg_ros.detector.tf_detection import TfDetection

from .tiny_model import TF_API, TFLITE, tf_outputs

BOX = [0.1, 0.2, 0.3, 0.4]


def tf(outputs: Mapping[str, np.ndarray], input_name: str = "x", offset: str = "auto") -> TfDetection:
    inputs = (Port(input_name, "uint8", (1, 30, 40, 3)),)
    ports = tuple(Port(name, "float", (None,)) for name in outputs)
    contract = recognise(Graph(inputs, ports, {}, outputs, 5, offset, (30, 40)))
    assert isinstance(contract, TfDetection)
    return contract


def classes_of(contract: TfDetection, outputs: Mapping[str, np.ndarray]) -> list[int]:
    return contract.read([outputs[name] for name in contract.names], 0.5).index.tolist()


def test_a_converted_model_counts_classes_from_zero_and_boxes_become_xyxy() -> None:
    outputs = tf_outputs([BOX, BOX], [2, 0], [0.9, 0.3])
    contract = tf(outputs)
    answer = contract.read([outputs[name] for name in contract.names], 0.5)
    assert answer.xyxy[0] == pytest.approx([0.2, 0.1, 0.4, 0.3])
    assert answer.index.tolist() == [2] and answer.score == pytest.approx([0.9])


def test_a_graph_of_the_detection_api_counts_from_one_whatever_the_order_of_its_outputs() -> None:
    outputs = tf_outputs([BOX], [3], [0.9], names=TF_API)
    shuffled = {name: outputs[name] for name in (TF_API[3], TF_API[2], TF_API[0], TF_API[1])}
    assert classes_of(tf(shuffled, "image_tensor:0"), shuffled) == [2]
    assert classes_of(tf(shuffled, "image_tensor:0", offset="0"), shuffled) == [3]
    assert classes_of(tf(outputs, "x", offset="1"), outputs) == [2]


def test_outputs_behind_the_count_are_not_read_and_the_count_may_be_absent() -> None:
    outputs = tf_outputs([BOX, BOX], [1, 4], [0.9, 0.9], count=1)
    assert classes_of(tf(outputs), outputs) == [1]
    without = {name: outputs[name] for name in TFLITE[:3]}
    assert classes_of(tf(without), without) == [1, 4]


CALLED = tuple(f"StatefulPartitionedCall:{k}" for k in range(4))


@pytest.mark.parametrize(
    "order", ["boxes classes scores count", "scores boxes count classes", "count scores classes boxes"]
)
@pytest.mark.parametrize("scores", [[0.9, 0.3], [1.0, 0.3]])
def test_outputs_whose_names_say_nothing_are_distinguished_by_their_values(order: str, scores: list[float]) -> None:
    values = dict(
        zip(("boxes", "classes", "scores", "count"), tf_outputs([BOX, BOX], [1, 0], scores).values(), strict=True)
    )
    outputs = {name: values[role] for name, role in zip(CALLED, order.split(), strict=True)}
    contract = tf(outputs)
    assert classes_of(contract, outputs) == [1]
    assert contract.read([outputs[name] for name in contract.names], 0.0).score == pytest.approx(scores)


@pytest.mark.parametrize(("classes", "scores"), [([1, 0], [1, 1]), ([0, 0], [0, 0]), ([2.5, 1.0], [0.5, 3.0])])
def test_outputs_that_neither_names_nor_values_distinguish_are_refused(
    classes: list[float], scores: list[float]
) -> None:
    outputs = tf_outputs([BOX, BOX], classes, scores, names=CALLED)
    with pytest.raises(
        ValueError, match=r"expected names or values that distinguish .*got .*rename its outputs, with `classes`"
    ):
        tf(outputs)


@pytest.mark.parametrize("names", [("boxes", "labels", "scores"), ("b", "detected_Class", "s"), ("b", "c", "Score")])
@pytest.mark.parametrize("swapped", [False, True])
def test_names_decide_even_where_the_values_do_not(names: tuple[str, ...], swapped: bool) -> None:
    outputs = tf_outputs([BOX, BOX], [1, 0], [1, 0], names=names)
    if swapped:
        outputs = dict(reversed(outputs.items()))
    contract = tf(outputs)
    assert contract.names == names


def test_raw_outputs_of_a_tf_graph_are_no_detections() -> None:
    raw = {"detection_multiclass_scores": np.zeros((1, 1, 6)), "raw_detection_boxes": np.zeros((1, 50, 4))}
    outputs = raw | tf_outputs([BOX], [3], [0.9], names=TF_API)
    assert classes_of(tf(outputs), outputs) == [2]


def test_rows_that_only_fill_the_answer_up_have_no_class() -> None:
    outputs = tf_outputs([BOX, [0.0] * 4], [3, 0], [0.9, 0.0], names=TF_API[:3])
    contract = tf(outputs)
    assert contract.read([outputs[name] for name in contract.names], 0.0).index.tolist() == [2]


def test_a_count_that_is_no_number_is_refused() -> None:
    outputs = tf_outputs([BOX], [3], [0.9], names=TF_API)
    contract = tf(outputs)
    outputs[TF_API[3]] = np.array([np.inf], np.float32)
    with pytest.raises(ValueError, match=r"expected how many boxes there are, got inf"):
        contract.read([outputs[name] for name in contract.names], 0.5)


def test_a_class_without_a_label_is_refused_with_what_to_do() -> None:
    outputs = tf_outputs([BOX], [7], [0.9])
    with pytest.raises(ValueError, match=r"expected one of 5 labels, got number 7 .*label_offset"):
        classes_of(tf(outputs), outputs)


@pytest.mark.parametrize(
    "outputs",
    [
        {"classification": np.zeros((1, 1000))},
        {"boxes": np.zeros((1, 5, 4)), "scores": np.zeros((1, 5))},
        {"boxes": np.zeros((1, 5, 4)), "classes": np.zeros((1, 6)), "scores": np.zeros((1, 6))},
        {"boxes": np.zeros((5, 4)), "labels": np.zeros(5), "scores": np.zeros(5)},
    ],
)
def test_other_outputs_are_refused_with_expected_and_got(outputs: Mapping[str, np.ndarray]) -> None:
    with pytest.raises(ValueError, match=r"expected boxes \[1,N,4\], classes .*got .*export the model"):
        tf(outputs)
