# SPDX-License-Identifier: Apache-2.0
"""The names of landmarks, from the command line and from a file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from objreg_tools.report.labels.label_names import class_of, names_text, read_names, unknown
from report.labels.scene import square


def test_the_command_line_goes_before_the_file(tmp_path: Path) -> None:
    file = tmp_path / "names.yaml"
    file.write_text("12: mug\n3: ''\n4:\n")
    assert read_names(file, ["12=big mug"]) == {12: "big mug", 3: "", 4: ""}


@pytest.mark.parametrize("text", ["mug", "x=mug", "=mug", "1=a\nb", "-1=mug"])
def test_a_text_that_names_no_landmark_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="--name: expected"):
        read_names(None, [text])


@pytest.mark.parametrize("text", ["- mug\n", "mug\n", "mug: 12\n", "12: [\n", "true: mug\n"])
def test_a_file_that_holds_no_names_is_refused_with_its_path(text: str, tmp_path: Path) -> None:
    (tmp_path / "names.yaml").write_text(text)
    with pytest.raises(ValueError, match=r"names\.yaml: expected"):
        read_names(tmp_path / "names.yaml")


def test_a_name_holds_by_any_id_and_an_empty_one_leaves_the_object_out() -> None:
    one = replace(square(3, "thing"), joined=(8,))
    assert class_of(one, {}) == "thing" and class_of(one, {}, named_only=True) == ""
    assert class_of(one, {8: "mug"}, named_only=True) == "mug" and class_of(one, {3: ""}) == ""
    assert unknown({8: "mug", 9: "cap"}, [one]) == [9]


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    file = tmp_path / "names.yaml"
    file.write_text(names_text([square(3, "thing"), square(5, "cup")], {5: "Löffel: gross", 3: ""}))
    assert read_names(file) == {3: "", 5: "Löffel: gross"}
