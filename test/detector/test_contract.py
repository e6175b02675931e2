# SPDX-License-Identifier: Apache-2.0
"""What a model's outputs mean."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from objreg_ros.detector.contract import RawSsd, TfDetection, recognise
from objreg_ros.detector.runtime import Port

from .tiny_model import TF_API, TFLITE, raw_metadata, tf_outputs

BOX = [0.1, 0.2, 0.3, 0.4]
PRIORS = np.array([[0.5, 0.5, 0.2, 0.2], [0.25, 0.25, 0.1, 0.3]], np.float32)
HEADS = {"loc": np.zeros((1, 2, 4)), "logits": np.array([[[0, 5, 0], [9, 0, 0]]], float)}


def tf(outputs: Mapping[str, np.ndarray], input_name: str = "x", offset: str = "auto") -> TfDetection:
    inputs = (Port(input_name, "uint8", (1, 30, 40, 3)),)
    ports = tuple(Port(name, "float", (None,)) for name in outputs)
    contract = recognise(inputs, ports, {}, outputs, 5, offset)
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
def test_outputs_whose_names_say_nothing_are_told_apart_by_their_values(order: str, scores: list[float]) -> None:
    values = dict(
        zip(("boxes", "classes", "scores", "count"), tf_outputs([BOX, BOX], [1, 0], scores).values(), strict=True)
    )
    outputs = {name: values[role] for name, role in zip(CALLED, order.split(), strict=True)}
    contract = tf(outputs)
    assert classes_of(contract, outputs) == [1]
    assert contract.read([outputs[name] for name in contract.names], 0.0).score == pytest.approx(scores)


@pytest.mark.parametrize(("classes", "scores"), [([1, 0], [1, 1]), ([0, 0], [0, 0]), ([2.5, 1.0], [0.5, 3.0])])
def test_outputs_that_neither_names_nor_values_tell_apart_are_refused(
    classes: list[float], scores: list[float]
) -> None:
    outputs = tf_outputs([BOX, BOX], classes, scores, names=CALLED)
    with pytest.raises(
        ValueError, match=r"expected names or values that tell .*got .*rename its outputs, with `classes`"
    ):
        tf(outputs)


@pytest.mark.parametrize("names", [("boxes", "labels", "scores"), ("b", "detected_Class", "s"), ("b", "c", "Score")])
@pytest.mark.parametrize("swapped", [False, True])
def test_names_tell_even_where_the_values_do_not(names: tuple[str, ...], swapped: bool) -> None:
    outputs = tf_outputs([BOX, BOX], [1, 0], [1, 0], names=names)
    if swapped:
        outputs = dict(reversed(outputs.items()))
    contract = tf(outputs)
    assert contract.names == names


def test_raw_outputs_of_a_tf_graph_are_no_detections() -> None:
    outputs = {"raw_detection_boxes": np.zeros((1, 50, 4))} | tf_outputs([BOX], [3], [0.9], names=TF_API)
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
        {"yolo": np.zeros((1, 84, 8400))},
    ],
)
def test_other_outputs_are_refused_with_expected_and_got(outputs: Mapping[str, np.ndarray]) -> None:
    with pytest.raises(ValueError, match=r"expected boxes \[1,N,4\], classes .*got .*export the model"):
        tf(outputs)


def encoded(priors: list[list[float]]) -> str:
    return raw_metadata(np.array(priors), [])["objreg.priors"]


def raw(heads: Mapping[str, np.ndarray], metadata: Mapping[str, str], labels: int = 2) -> RawSsd:
    ports = tuple(Port(name, "float", (None,)) for name in heads)
    contract = recognise((Port("x", "uint8", (1, 30, 40, 3)),), ports, metadata, heads, labels, "auto")
    assert isinstance(contract, RawSsd)
    return contract


def test_raw_heads_become_the_priors_that_are_no_background() -> None:
    contract = raw(HEADS, raw_metadata(PRIORS, ["a", "b"]))
    answer = contract.read([HEADS[name] for name in contract.names], 0.5)
    assert answer.xyxy == pytest.approx(np.array([[0.4, 0.4, 0.6, 0.6]]), abs=1e-6)
    assert answer.index.tolist() == [0]
    assert answer.score == pytest.approx([np.exp(5) / (np.exp(5) + 2)])


def test_one_prior_may_give_two_labels_below_one_half() -> None:
    heads = {"loc": np.zeros((1, 2, 4)), "logits": np.array([[[0, 3, 3], [9, 0, 0]]], float)}
    contract = raw(heads, raw_metadata(PRIORS, ["a", "b"]))
    assert contract.read([heads[name] for name in contract.names], 0.3).index.tolist() == [0, 1]


@pytest.mark.parametrize("threshold", [0.0, 0.1, 0.5, 0.9])
def test_no_row_that_reaches_the_threshold_is_lost_to_the_shortcut(threshold: float) -> None:
    logits = np.random.default_rng(1).normal(0, 3, (1, 400, 4)).astype(np.float32)
    heads = {"loc": np.zeros((1, 400, 4), np.float32), "logits": logits}
    contract = raw(heads, raw_metadata(np.tile(PRIORS[:1], (400, 1)), ["a", "b", "c"]), labels=3)
    exponent = np.exp(logits[0])
    expected = (exponent[:, 1:] / exponent.sum(axis=1, keepdims=True) >= threshold).sum()
    assert len(contract.read([heads["loc"], logits], threshold).index) == expected


def test_priors_that_do_not_match_the_heads_are_refused() -> None:
    with pytest.raises(ValueError, match=r"from 1 priors and 2 labels, got loc \[1, 2, 4\]"):
        raw(HEADS, raw_metadata(PRIORS[:1], ["a", "b"]))


@pytest.mark.parametrize("rows", [1, 3])
def test_heads_of_another_size_of_picture_are_refused(rows: int) -> None:
    contract = raw(HEADS, raw_metadata(PRIORS, ["a", "b"]))
    with pytest.raises(ValueError, match=rf"expected a row for each of 2 priors, got \(1, {rows}\)"):
        contract.read([np.zeros((1, rows, 4)), np.zeros((1, rows, 3))], 0.5)


def test_fewer_labels_than_classes_are_refused() -> None:
    with pytest.raises(ValueError, match=r"expected .*2 priors and 1 labels"):
        raw(HEADS, raw_metadata(PRIORS, ["a"]), labels=1)


@pytest.mark.parametrize(
    "changed",
    [
        {"objreg.contract": "ssd_raw/9"},
        {"objreg.priors": "no base64!"},
        {"objreg.priors": "AAAA"},
        {"objreg.priors": encoded([[0.5, 0.5, np.nan, 0.2], [0.5, 0.5, 0.2, 0.2]])},
        {"objreg.priors": encoded([[0.5, 0.5, 0.2, 0.2], [np.inf, 0.5, 0.2, 0.2]])},
        {"objreg.priors": encoded([[0.5, 0.5, 0.2, 0.2], [0.5, 0.5, 0.0, 0.2]])},
        {"objreg.variances": "[1, 2]"},
        {"objreg.variances": "[0.1, 0.1, NaN, 0.2]"},
        {"objreg.variances": "[0.1, 0.1, 0.2, Infinity]"},
        {"objreg.variances": "[0.1, 0.1, 0.2, 1e300]"},
        {"objreg.variances": "[0.1, 0.1, 0.2, -0.2]"},
        {"objreg.variances": f"[0.1, 0.1, 0.2, 1{'0' * 400}]"},
        {"objreg.variances": "[" * 100_000},
    ],
)
def test_metadata_of_another_kind_are_refused(changed: dict[str, str]) -> None:
    key = next(iter(changed))
    with pytest.raises(ValueError, match=f"{key}: expected|expected {key}") as refusal:
        raw(HEADS, raw_metadata(PRIORS, ["a", "b"]) | changed)
    assert len(str(refusal.value)) < 400 and "got" in str(refusal.value)


def test_raw_heads_without_metadata_are_refused() -> None:
    with pytest.raises(ValueError, match=r"expected objreg\.contract ssd_raw/1"):
        raw(HEADS, {})
