# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from bridge import sample_messages as messages
from objreg_ros.bridge.messages.layout import DETECTIONS, OBJECTS, VIEW, columns, fields_of, table, whole_numbers


def test_our_tables_are_packed_and_colour_goes_as_float() -> None:
    assert (DETECTIONS.itemsize, OBJECTS.itemsize, VIEW.itemsize) == (26, 42, 16)
    assert fields_of(VIEW) == [("x", 0, 7), ("y", 4, 7), ("z", 8, 7), ("rgb", 12, 7)]
    assert fields_of(DETECTIONS)[5] == ("class_id", 20, 4)


@pytest.mark.parametrize("layout", [DETECTIONS, OBJECTS, VIEW])
def test_a_table_that_is_sent_is_the_table_that_is_read(layout: np.dtype) -> None:
    sent = np.frombuffer(np.random.default_rng(0).bytes(7 * layout.itemsize), layout)
    got = table(messages.own_table(sent))
    assert got.dtype == layout and got.tobytes() == sent.tobytes()


def test_reading_a_table_copies_nothing() -> None:
    message = messages.own_table(np.zeros(4, VIEW))
    assert np.shares_memory(table(message), np.frombuffer(message.data, np.uint8))


def test_a_field_of_several_values_is_a_column_of_arrays() -> None:
    message = messages.cloud(np.zeros((1, 2), [("histogram", "<f4"), ("b", "<f4"), ("c", "<f4")]))
    message.fields = message.fields[:1]
    message.fields[0].count = 3
    assert table(message)["histogram"].shape == (1, 2, 3)


def test_a_column_that_is_needed_has_one_value_a_point() -> None:
    message = messages.own_table(np.zeros(4, DETECTIONS))
    message.fields[5].count = 2
    with pytest.raises(ValueError, match="expected a count of 1 of field 'class_id', got 2"):
        table(message, "class_id")
    message = messages.own_table(np.zeros(4, VIEW))
    message.fields[2].count = 2  # over rgb: what it holds is not asked for
    message.fields[3].count, message.point_step = 2, 20
    with pytest.raises(ValueError, match="expected a count of 1 of field 'rgb', got 2"):
        table(message, "x")


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"point_step": 2**32 - 1}, "expected a point_step of 1 to 65536 bytes, got 4294967295"),
        ({"fields": [SimpleNamespace(name=str(k), offset=0, datatype=2, count=1) for k in range(300)]}, "at most 200"),
        ({"fields": [SimpleNamespace(name="x", offset=0, datatype=7, count=2**32 - 1)]}, "got a count of 4294967295"),
        ({"fields": [SimpleNamespace(name="", offset=0, datatype=7, count=1)]}, "a field's name of 1 to 1000"),
    ],
)
def test_a_layout_beyond_all_sense_is_refused_before_memory_is_taken(changes: dict, complaint: str) -> None:
    message = messages.own_table(np.zeros(4, VIEW))
    for name, value in changes.items():
        setattr(message, name, value)
    with pytest.raises(ValueError, match=complaint):
        table(message)


@pytest.mark.parametrize("kind", ["i1", "u1", "i2", "u2", "i4", "u4"])
def test_whole_numbers_may_be_of_any_integer_type(kind: str) -> None:
    records = np.array([[(3,), (100,)]], [("n", kind)])
    numbers = whole_numbers(records, "n")
    assert numbers.dtype == np.int64 and numbers.tolist() == [[3, 100]]
    assert whole_numbers(records[:, :0], "n").shape == (1, 0)


@pytest.mark.parametrize(
    ("value", "kind", "complaint"),
    [(np.inf, "f4", "whole numbers in field 'n', got float32"), (-1, "i2", "got -1 to -1"), (65536, "u4", "got 65536")],
)
def test_what_is_no_whole_number_of_16_bits_is_refused(value: float, kind: str, complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        whole_numbers(np.array([[(value,)]], [("n", kind)]), "n")


def test_a_single_row_may_leave_its_row_step_out() -> None:
    message = messages.cloud(np.ones((1, 5), [("x", "<f4")]))
    message.row_step = 0
    assert table(message)["x"].tolist() == [[1, 1, 1, 1, 1]]


def test_one_name_twice_is_refused() -> None:
    message = messages.cloud(np.zeros((1, 2), [("x", "<f4"), ("y", "<f4")]))
    message.fields[1].name = "x"
    with pytest.raises(ValueError, match="'x' twice"):
        table(message)


def test_columns_of_any_type_come_as_float32() -> None:
    records = np.array([[(1, 2.5)]], [("a", ">i2"), ("b", ">f8")])
    assert columns(records, "b", "a").tolist() == [[[2.5, 1.0]]] and columns(records, "a").dtype == np.float32


@pytest.mark.parametrize("kind", ["i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8"])
@pytest.mark.parametrize("order", ["<", ">"])
def test_a_field_of_every_datatype_is_read(kind: str, order: str) -> None:
    values = np.array([[1, 100]], order + kind)
    records = np.zeros((1, 2), [("pad", order + "u4"), ("a", order + kind)])
    records["a"] = values
    assert table(messages.cloud(records))["a"].tolist() == [[1, 100]]
