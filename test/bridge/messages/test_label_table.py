# SPDX-License-Identifier: Apache-2.0
"""The numbers of names that no table announced."""

from __future__ import annotations

import pytest

from objreg_ros import limits
from objreg_ros.bridge.messages import label_table
from objreg_ros.bridge.messages.label_table import LabelTable
from objreg_ros.data.frames import UNNAMED


def test_a_name_that_is_met_gets_a_number_once() -> None:
    table = LabelTable()
    assert table.include(["cup", "tv"]) and not table.include(["tv"])
    assert sorted(table.names.values()) == ["cup", "tv"] and sorted(table.names) == [0, 1]


def test_names_that_were_announced_keep_their_numbers_and_others_come_behind_them() -> None:
    table = LabelTable()
    table.adopt_table({3: "cup"})
    assert table.include(["cup", "tv"]) and table.names == {3: "cup", 4: "tv"}


def test_what_was_met_stays_when_another_table_is_announced() -> None:
    table = LabelTable()
    table.include(["tv"])
    table.adopt_table({0: "cup", 1: "dog"})
    assert table.names == {0: "cup", 1: "dog", 2: "tv"}
    table.adopt_table(table.names)
    assert table.names == {0: "cup", 1: "dog", 2: "tv"}


def test_a_table_that_somebody_holds_does_not_change() -> None:
    table = LabelTable()
    held = table.names
    table.include(["cup"])
    assert held == {}


def test_what_has_no_name_needs_no_number() -> None:
    assert not LabelTable().include([UNNAMED])


def test_a_detector_that_puts_something_else_into_its_names_is_refused_and_costs_no_name_that_is_known(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(label_table, "MOST_MET", 2)
    table = LabelTable()
    table.include(["cup", "tv"])
    with pytest.raises(ValueError, match="expected at most 2 names of classes, got 'track 1'"):
        table.include(["track 1"])
    assert not table.include(["cup"])


def test_a_number_that_no_class_can_have_is_refused_and_nothing_changes() -> None:
    table = LabelTable()
    table.adopt_table({65533: "cup"})
    with pytest.raises(ValueError, match="expected numbers of at most 65533, got 65534"):
        table.include(["tv"])
    assert table.names == {65533: "cup"}


def test_names_that_are_too_long_together_are_refused_and_nothing_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "MOST_LABELS_TEXT", 40)
    table = LabelTable()
    assert table.include(["cup"])
    with pytest.raises(ValueError, match="expected names of at most 40 characters, got"):
        table.include(["a" * 40])
    assert table.names == {0: "cup"} and table.include(["tv"])
